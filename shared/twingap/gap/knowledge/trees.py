"""Boosted trees as flat arrays: evaluation of one row in microseconds, and a compact form for files.

scikit-learn's boosting --nodes of all trees in preorder--> Boosted --row by row--> raw prediction

A search evaluates hundreds of models on single rows, where the input validation and threads of scikit-learn take
milliseconds. Nodes are read from an attribute that scikit-learn does not document; a test compares the result with
scikit-learn's own predictions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

Array = NDArray[np.float64]

LEAF: Final = 255
"""Column number that marks a leaf; features have smaller numbers."""
_UNKNOWN_LEFT: Final = 128
"""Bit of `Boosted.right`: a row whose feature is NaN goes to the left."""


@dataclass(frozen=True)
class Boosted:
    """A sum of trees over numeric features.

    Nodes of a tree follow each other in preorder: a node's left child is the next one.

    Parameters
    ----------
    start : float
        Constant that the trees add to.
    roots : Array [trees]
        Index of each tree's root among the nodes.
    column : Array [nodes]
        Feature that a node compares; `LEAF` in a leaf.
    right : Array [nodes]
        Distance to the right child, 0 to 127; plus 128 where a row whose feature is NaN goes to the left.
    value : Array [nodes]
        Largest feature value that goes to the left; in a leaf, what it adds.
    """

    start: float
    roots: NDArray[np.int64]
    column: NDArray[np.uint8]
    right: NDArray[np.uint8]
    value: NDArray[np.float32]

    @classmethod
    def of(cls, model: HistGradientBoostingClassifier | HistGradientBoostingRegressor) -> Boosted:
        """A fitted model of one output without categorical features.

        Thresholds are rounded down to float32, which leaves every comparison with a float32 feature as it was.

        Raises
        ------
        ValueError
            For several outputs, categorical features, more than 254 features, or trees of more than 127 nodes.
        """
        rounds: list[list[Any]] = model._predictors
        trees = [tree.nodes for trees in rounds for tree in trees]
        if any(len(trees) != 1 for trees in rounds) or any(nodes["is_categorical"].any() for nodes in trees):
            raise ValueError("a model of one output over numeric features is expected")
        sizes = np.array([len(nodes) for nodes in trees])
        nodes = np.concatenate(trees)
        inner, own = ~nodes["is_leaf"].astype(bool), np.concatenate([np.arange(size) for size in sizes])
        if (nodes["left"][inner] != own[inner] + 1).any():
            raise ValueError("nodes in preorder are expected")
        if nodes["feature_idx"][inner].max(initial=0) >= LEAF or sizes.max(initial=0) >= _UNKNOWN_LEFT:
            raise ValueError("at most 254 features and 127 nodes a tree are expected")
        right = np.where(inner, nodes["right"] - own, 0) + _UNKNOWN_LEFT * nodes["missing_go_to_left"].astype(bool)
        return cls(
            float(np.ravel(model._baseline_prediction)[0]),
            np.cumsum(sizes) - sizes,
            np.where(inner, nodes["feature_idx"], LEAF).astype(np.uint8),
            right.astype(np.uint8),
            np.where(inner, _rounded_down(nodes["num_threshold"]), nodes["value"]).astype(np.float32),
        )

    def raw(self, rows: NDArray[np.float32]) -> Array:
        """[rows] Log odds of a classifier before calibration, or a regressor's value; NaN marks unknown features."""
        out = np.full(len(rows), self.start)
        _add_trees(np.ascontiguousarray(rows), self.roots, self.column, self.right, self.value, out)
        return out


def _rounded_down(value: Array) -> NDArray[np.float32]:
    """The largest float32 that is not larger than each value."""
    near = value.astype(np.float32)
    return np.where(near > value, np.nextafter(near, np.float32(-np.inf)), near)


@njit()
def _add_trees(rows, roots, column, right, value, out):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Add the prediction of all trees for each row [rows, features] to `out` [rows], in place."""
    for i in range(rows.shape[0]):
        for k in range(roots.size):
            at = roots[k]
            while column[at] != LEAF:
                x, apart = rows[i, column[at]], right[at]
                goes_left = apart >= _UNKNOWN_LEFT if x != x else x <= value[at]
                at += 1 if goes_left else apart % _UNKNOWN_LEFT
            out[i] += value[at]
