"""Sum of decision trees as flat arrays, for prediction and storage without scikit-learn.

scikit-learn's gradient boosting --nodes of all trees, concatenated--> Trees <--arrays--> .npz

Nodes are in depth-first order, so that the left child is the next node and only the index of the right one is stored.
Thresholds are rounded down to single precision, which does not change comparisons with single-precision features.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingClassifier

Array = NDArray[np.float64]
ROWS_AT_ONCE = 256
"""Rows that are evaluated together; more need more memory and are hardly faster."""


@dataclass(frozen=True)
class Trees:
    """Sum of decision trees with one or several outputs.

    Parameters
    ----------
    start : float32 array [outputs]
        Constant term.
    roots : int32 array [trees]
        Index of each tree's root.
    column : int16 array [nodes]
        Index of the feature of a node; -1 in a leaf.
    threshold : float32 array [nodes]
        Rows with a feature up to it go to the next node, others to `right`; 0 in a leaf.
    right : int32 array [nodes]
        Index of the right child; in a leaf, its row of `values`.
    values : float32 array [leaves, outputs]
        Terms of the leaves.
    """

    start: NDArray[np.float32]
    roots: NDArray[np.int32]
    column: NDArray[np.int16]
    threshold: NDArray[np.float32]
    right: NDArray[np.int32]
    values: NDArray[np.float32]

    @classmethod
    def of_boosting(cls, model: HistGradientBoostingClassifier) -> Trees:
        """Trees of a fitted classifier of several classes; outputs are log probabilities up to a constant.

        Uses undocumented attributes of scikit-learn.
        """
        rounds: list[list[Any]] = model._predictors
        classes = len(rounds[0])
        grown = []
        for trees in rounds:
            for output, tree in enumerate(trees):
                n = tree.nodes
                leaf = n["is_leaf"].astype(bool)
                values = np.zeros((len(n), classes))
                values[:, output] = n["value"]
                column = np.where(leaf, -1, n["feature_idx"])
                grown.append((column, n["num_threshold"], n["left"].astype(int), n["right"].astype(int), values))
        return cls._of(np.ravel(model._baseline_prediction), grown)

    @classmethod
    def _of(cls, start: Array, grown: list[tuple[Any, Any, Any, Any, Any]]) -> Trees:
        roots, columns, thresholds, rights, values = [], [], [], [], []
        nodes = leaves = 0
        for column, threshold, left, right, value in grown:
            order = _left_first(column, left, right)
            place = np.empty(len(column), dtype=np.int64)
            place[order] = np.arange(nodes, nodes + len(order))
            own = column[order]
            leaf = own < 0
            following = np.where(leaf, 0, place[right[order]])
            following[leaf] = np.arange(leaves, leaves + leaf.sum())
            roots.append(nodes)
            columns.append(own)
            thresholds.append(np.where(leaf, 0.0, threshold[order]))
            rights.append(following)
            values.append(value[order][leaf])
            nodes, leaves = nodes + len(order), leaves + int(leaf.sum())
        return cls(
            start.astype(np.float32),
            np.array(roots, dtype=np.int32),
            np.concatenate(columns).astype(np.int16),
            _rounded_down(np.concatenate(thresholds)),
            np.concatenate(rights).astype(np.int32),
            np.concatenate(values).astype(np.float32),
        )

    def __call__(self, rows: NDArray[np.float32]) -> Array:
        """Sum over all trees [rows, outputs].

        Parameters
        ----------
        rows : float32 array [rows, features]
            Features, finite.
        """
        parts = [self._some(rows[i : i + ROWS_AT_ONCE]) for i in range(0, len(rows), ROWS_AT_ONCE)]
        return np.concatenate(parts) if parts else np.empty((0, self.start.size))

    def _some(self, rows: NDArray[np.float32]) -> Array:
        at = np.repeat(self.roots[None, :], len(rows), axis=0)
        row = np.arange(len(rows))[:, None]
        while (inner := (column := self.column[at]) >= 0).any():
            goes_left = rows[row, np.maximum(column, 0)] <= self.threshold[at]
            at = np.where(inner, np.where(goes_left, at + 1, self.right[at]), at)
        leaf = self.right[at]
        out = np.repeat(self.start[None, :].astype(np.float64), len(rows), axis=0)
        for tree in range(at.shape[1]):
            out += self.values[leaf[:, tree]]
        return out

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
            found = cls(**{name: np.asarray(arrays[name]) for name in cls.__dataclass_fields__})
        except KeyError as error:
            raise TwingapError(f"lacks the array {error}", where=where, mend="install twingap again") from None
        nodes, leaf = found.column.size, found.column < 0
        reached = np.where(leaf, len(found.values), nodes)
        sound = (
            found.threshold.shape == found.right.shape == (nodes,)
            and bool(((found.right >= 0) & (found.right < reached)).all())
            and bool(((found.roots >= 0) & (found.roots < nodes)).all())
            and bool((leaf | (found.right > np.arange(nodes))).all())
            and found.values.shape == (int(leaf.sum()), found.start.size)
            and bool(leaf[-1])
        )
        if not sound:
            raise TwingapError("contains no valid trees", where=where, mend="install twingap again")
        return found


def _left_first(column: NDArray[Any], left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.int64]:
    """Nodes in depth-first order, left child first."""
    order, open_ = [], [0]
    while open_:
        node = open_.pop()
        order.append(node)
        if column[node] >= 0:
            open_ += [int(right[node]), int(left[node])]
    return np.array(order)


def _rounded_down(threshold: Array) -> NDArray[np.float32]:
    single = threshold.astype(np.float32)
    above = single.astype(np.float64) > threshold
    return np.where(above, np.nextafter(single, np.float32(-np.inf)), single)
