"""Boosted trees, once learnt, as flat arrays: one row through all of them takes microseconds.

scikit-learn's boosting --nodes of all trees, end to end--> Boosted --row by row--> raw prediction

A search asks hundreds of models about one row, again and again. scikit-learn checks its input and starts threads for
every tree, which takes milliseconds where the comparisons take microseconds. Nodes are read off an attribute that it
does not document; a test holds the outcome against its own predictions, to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Boosted:
    """A sum of trees over numeric features.

    Parameters
    ----------
    start : float
        What the trees add to.
    roots : Array [trees]
        Place of each tree's root among the nodes.
    column : Array [nodes]
        Feature that a node looks at; -1 in a leaf.
    threshold : Array [nodes]
        Up to which a row goes to the left.
    unknown_left : Array [nodes]
        Whether a row does so whose feature is NaN.
    left, right : Array [nodes]
        Places of what follows.
    value : Array [nodes]
        Of a leaf.
    """

    start: float
    roots: NDArray[np.int32]
    column: NDArray[np.int32]
    threshold: Array
    unknown_left: NDArray[np.bool_]
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    value: Array

    @classmethod
    def of(cls, model: HistGradientBoostingClassifier | HistGradientBoostingRegressor) -> Boosted:
        """A fitted model of one output without categorical features.

        Raises
        ------
        ValueError
            For several outputs or categorical features, which nothing here is learnt with.
        """
        rounds: list[list[Any]] = model._predictors
        trees = [tree.nodes for trees in rounds for tree in trees]
        if any(len(trees) != 1 for trees in rounds) or any(nodes["is_categorical"].any() for nodes in trees):
            raise ValueError("a model of one output over numeric features is expected")
        counts = np.array([len(nodes) for nodes in trees])
        roots = np.cumsum(counts) - counts
        nodes, first = np.concatenate(trees), np.repeat(roots, counts)
        leaf = nodes["is_leaf"].astype(bool)
        return cls(
            float(np.ravel(model._baseline_prediction)[0]),
            roots.astype(np.int32),
            np.where(leaf, -1, nodes["feature_idx"]).astype(np.int32),
            np.ascontiguousarray(nodes["num_threshold"]),
            nodes["missing_go_to_left"].astype(bool),
            (nodes["left"] + first).astype(np.int32),
            (nodes["right"] + first).astype(np.int32),
            np.ascontiguousarray(nodes["value"]),
        )

    def raw(self, rows: NDArray[np.float32]) -> Array:
        """[rows] Log odds of a classifier as it learnt them, or a regressor's value.

        Parameters
        ----------
        rows : Array [rows, features]
            NaN where a feature is not known.
        """
        out = np.full(len(rows), self.start)
        _add_trees(
            np.ascontiguousarray(rows), self.roots, self.column, self.threshold, self.unknown_left, self.left,
            self.right, self.value, out,
        )  # fmt: skip
        return out


@njit(cache=True, nogil=True)
def _add_trees(rows, roots, column, threshold, unknown_left, left, right, value, out):  # type: ignore[no-untyped-def]  # pragma: no cover
    for i in range(len(rows)):
        for root in roots:
            at = root
            while column[at] >= 0:
                x = rows[i, column[at]]
                goes_left = unknown_left[at] if np.isnan(x) else x <= threshold[at]
                at = left[at] if goes_left else right[at]
            out[i] += value[at]
