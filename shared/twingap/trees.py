"""Gradient-boosted trees as flat arrays: fast prediction of single rows, and a compact form for files.

scikit-learn's gradient boosting --nodes of all trees in preorder--> Trees <--arrays--> files

A search evaluates hundreds of models on single rows, where the input validation and threads of scikit-learn take
milliseconds. Nodes are read from attributes that scikit-learn does not document; a test compares predictions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit
from twingap.errors import TwingapError

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trees:
    """A sum of trees over numeric features, with one or several outputs.

    Nodes of a tree follow each other in preorder: a node's left child is the next one.

    Parameters
    ----------
    start : Array [outputs]
        Constants that the trees add to.
    roots : Array [trees]
        Index of each tree's root among the nodes. Tree k adds to output k modulo the number of outputs.
    column : unsigned array [nodes]
        Feature that a node compares; the largest number of the type in a leaf.
    right : unsigned array [nodes]
        Distance to the right child; the highest bit is set where a row whose feature is NaN goes to the left.
    value : Array [nodes]
        Largest feature value that goes to the left; in a leaf, what it adds.
    """

    start: Array
    roots: NDArray[np.int64]
    column: NDArray[np.unsignedinteger[Any]]
    right: NDArray[np.unsignedinteger[Any]]
    value: NDArray[np.float32]

    @classmethod
    def of_boosting(cls, model: HistGradientBoostingClassifier | HistGradientBoostingRegressor) -> Trees:
        """A fitted model without categorical features.

        Outputs are a regressor's value, log odds of the second of two classes, or log probabilities of several classes
        up to a constant. Thresholds are rounded down to float32, which leaves every comparison with a float32 feature
        as it was.

        Raises
        ------
        ValueError
            For categorical features.
        """
        rounds: list[list[Any]] = model._predictors
        trees = [tree.nodes for trees in rounds for tree in trees]
        nodes, sizes = np.concatenate(trees), np.array([len(nodes) for nodes in trees])
        inner, own = ~nodes["is_leaf"].astype(bool), np.concatenate([np.arange(size) for size in sizes])
        if nodes["is_categorical"].any() or (nodes["left"][inner] != own[inner] + 1).any():
            raise ValueError("numeric features and nodes in preorder are expected")
        of_column = np.min_scalar_type(int(nodes["feature_idx"].max()) + 1)
        of_right = np.min_scalar_type(2 * int(sizes.max()))
        right = np.where(inner, nodes["right"] - own, 0)
        right += nodes["missing_go_to_left"].astype(bool) * _highest_bit(of_right)
        return cls(
            np.ravel(model._baseline_prediction).astype(float),
            np.cumsum(sizes) - sizes,
            np.where(inner, nodes["feature_idx"], np.iinfo(of_column).max).astype(of_column),
            right.astype(of_right),
            np.where(inner, _rounded_down(nodes["num_threshold"]), nodes["value"]).astype(np.float32),
        )

    def __call__(self, rows: NDArray[np.float32]) -> Array:
        """Sum over all trees [rows, outputs] for rows [rows, features]; NaN marks unknown features."""
        out = np.tile(self.start, (len(rows), 1))
        leaf, unknown_left = np.iinfo(self.column.dtype).max, _highest_bit(self.right.dtype)
        _add_trees(np.ascontiguousarray(rows), self.roots, self.column, self.right, self.value, leaf, unknown_left, out)
        return out

    @property
    def columns(self) -> int:
        """Smallest number of features that rows need."""
        return int(self.column[~self.is_leaf].max(initial=0)) + 1

    @property
    def is_leaf(self) -> NDArray[np.bool_]:
        """[nodes] Whether each node is a leaf."""
        return np.asarray(self.column == np.iinfo(self.column.dtype).max)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All arrays by name, for storage."""
        return dict(vars(self))

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]], *, where: str) -> Trees:
        """Trees from `arrays`.

        Raises
        ------
        TwingapError
            For missing or inconsistent arrays.
        """
        try:
            found = cls(**{field.name: np.asarray(arrays[field.name]) for field in fields(cls)})
        except KeyError as error:
            raise TwingapError(f"lacks the array {error}", where=where, mend="install twingap again") from None
        if not found._is_sound():
            raise TwingapError("contains no valid trees", where=where, mend="install twingap again")
        return found

    def _is_sound(self) -> bool:
        """Whether every row reaches a leaf of every tree."""
        count = self.column.size
        sound = (
            self.column.dtype.kind + self.right.dtype.kind == "uu"
            and self.column.shape == self.right.shape == self.value.shape == (count,)
            and self.start.ndim == 1
            and self.roots.size % max(self.start.size, 1) == 0
            and bool(((self.roots >= 0) & (self.roots < count)).all())
        )
        if not sound:
            return False
        inner = ~self.is_leaf
        step = (self.right % _highest_bit(self.right.dtype)).astype(int)[inner]
        return bool(((step > 0) & (np.flatnonzero(inner) + step < count)).all() and not inner[-1:].any())


def _highest_bit(kind: np.dtype[Any]) -> int:
    return 1 << (8 * kind.itemsize - 1)


def _rounded_down(value: Array) -> NDArray[np.float32]:
    """The largest float32 that is not larger than each value."""
    near = value.astype(np.float32)
    return np.where(near > value, np.nextafter(near, np.float32(-np.inf)), near)


@njit()
def _add_trees(  # type: ignore[no-untyped-def]  # pragma: no cover
    rows, roots, column, right, value, leaf, unknown_left, out
):
    """Add the prediction of all trees for each row [rows, features] to `out` [rows, outputs], in place."""
    for i in range(rows.shape[0]):
        for k in range(roots.size):
            at = roots[k]
            while column[at] != leaf:
                x, apart = rows[i, column[at]], right[at]
                goes_left = apart >= unknown_left if x != x else x <= value[at]
                at += 1 if goes_left else apart % unknown_left
            out[i, k % out.shape[1]] += value[at]
