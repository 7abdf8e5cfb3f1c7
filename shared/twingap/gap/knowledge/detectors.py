"""Trees that read examples: whether an effect is missing (log odds), and a parameter's value.

features [examples, columns] --those that tell--> trees, one a fold of whole machines --> Ensemble, Estimator
                                                   what each says of machines it has not seen --> its calibration
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.knowledge.trees import Boosted

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FOLDS: Final = 5
_KEPT: Final = 170
_KNOWN: Final = 0.12
"""Part of the examples in which a feature must be known for anything to be learnt from it."""
_LEAST_OFF: Final = 0.02
"""Part of the usual largest error below which estimates count as exact."""
_FEWEST: Final = 25
"""Examples of an effect below which nothing is learnt of it."""


@dataclass
class Ensemble:
    """One model per fold over the features that matter, and what it said of examples it had not seen."""

    columns: NDArray[np.int64]
    models: list[Boosted]
    line: tuple[float, float] = (1.0, 0.0)
    line_later: tuple[float, float] = (1.0, 0.0)
    unseen: Array = field(default_factory=lambda: np.empty(0))

    def score(self, features: NDArray[Any], *, later: bool = False) -> Array:
        """[examples] Log odds of a classifier, or a regressor's value, averaged over folds.

        `later`: effects have been added to the twin. What looks like one more is then more often what they left over.
        """
        own = np.asarray(np.asarray(features)[:, self.columns], np.float32)
        slope, offset = self.line_later if later else self.line
        return np.asarray(slope * np.mean([model.raw(own) for model in self.models], axis=0) + offset)


@dataclass(frozen=True)
class Anchor:
    """A line over one feature.

    Parameters
    ----------
    column : int
    logarithmic : bool
        Whether the line runs over the feature's logarithm.
    line : (float, float)
        Slope and offset.
    """

    column: int
    logarithmic: bool
    line: tuple[float, float]

    def read(self, features: NDArray[Any]) -> Array:
        """[examples] NaN where the feature is not known."""
        x = np.asarray(features[:, self.column], float)
        at = np.log(np.maximum(np.abs(x), 1e-9)) if self.logarithmic else x
        return np.where(np.isfinite(x), self.line[0] * np.where(np.isfinite(x), at, 0.0) + self.line[1], np.nan)


@dataclass
class Estimator:
    """A parameter's value: a line over the feature that tells most, and trees for the rest where they help.

    Parameters
    ----------
    anchors : tuple of Anchor
        The feature that tells it best where it is known, and others for where it is not.
    middle : float
        The value where none of them is known.
    rest : Ensemble or None
        What trees add; None where the line alone did better on machines not learnt from.
    error : float
        Nine of ten estimates for machines not learnt from were off by less (in comparable numbers).
    doubt : Ensemble or None
        Logarithm of how far an estimate is off, from the same features: teeth are read exactly, or not at all.
    reach : float
        Nine of ten estimates were off by less than this many times what `doubt` says.
    """

    anchors: tuple[Anchor, ...]
    middle: float
    rest: Ensemble | None
    error: float
    doubt: Ensemble | None = None
    reach: float = 1.0

    def estimate(self, features: NDArray[Any]) -> Array:
        """[examples] Comparable numbers, see `parameters`."""
        line = _on_lines(features, self.anchors, self.middle)
        return line if self.rest is None else line + self.rest.score(features)

    def within(self, features: NDArray[Any]) -> Array:
        """[examples] How far nine of ten estimates like these are off at most, comparable numbers."""
        if self.doubt is None:
            return np.full(len(features), self.error)
        return np.asarray(self.reach * np.exp(self.doubt.score(features)))


def _on_lines(features: NDArray[Any], anchors: Sequence[Anchor], middle: float) -> Array:
    """[examples] What the first anchor says that is known."""
    out = np.full(len(features), np.nan)
    for anchor in anchors:
        out = np.where(np.isfinite(out), out, anchor.read(features))
    return np.where(np.isfinite(out), out, middle)


def folds(machine: NDArray[np.int64], count: int = FOLDS) -> NDArray[np.int64]:
    """[examples] Fold of each example, by machine."""
    return np.asarray(machine % count)


class Table:
    """Features of examples, with their ranks worked out once for all that is learnt from them."""

    def __init__(self, features: NDArray[np.float32]) -> None:
        self.values = features
        self.ranks = np.zeros_like(features)
        for j in range(features.shape[1]):
            known = np.isfinite(features[:, j])
            if known.sum() >= _FEWEST and np.ptp(features[known, j]) > 0:
                place = np.argsort(np.argsort(features[known, j])).astype(float)
                self.ranks[known, j] = (place - place.mean()) / (place.std() * np.sqrt(len(features)))

    def take(self, rows: Mask) -> Table:
        """Some of the examples; their ranks stay those among all."""
        part = Table.__new__(Table)
        part.values, part.ranks = self.values[rows], self.ranks[rows]
        return part

    def telling(self, target: Array, allowed: Sequence[int]) -> NDArray[np.int64]:
        """Those of the allowed columns that tell most: by rank correlation, and by what random trees split on."""
        from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor

        own = np.asarray(allowed, int)
        # What is known of a handful of machines only may be unknown in a whole fold.
        own = own[np.isfinite(self.values[:, own]).mean(axis=0) >= _KNOWN]
        if own.size <= _KEPT:
            return np.asarray(own)
        place = np.argsort(np.argsort(target)).astype(np.float32)
        ranked = np.abs(self.ranks[:, own].T @ (place - place.mean()))
        binary = np.isin(target, (0.0, 1.0)).all()
        kind = ExtraTreesClassifier if binary else ExtraTreesRegressor
        trees = kind(n_estimators=48, max_features=0.1, min_samples_leaf=4, n_jobs=1, random_state=0)
        weight = trees.fit(self.values[:, own], target).feature_importances_
        by_trees, by_rank = np.argsort(-weight)[: 2 * _KEPT // 3], np.argsort(-ranked)[: _KEPT // 3]
        return np.asarray(own[np.unique(np.concatenate((by_trees, by_rank)))])


def learn_classifier(
    table: Table,
    label: Mask,
    machine: NDArray[np.int64],
    allowed: Sequence[int],
    first: Mask | None = None,
    counted: Mask | None = None,
) -> Ensemble | None:
    """A detector with calibrated log odds, or None when there are too few examples of either kind.

    Parameters
    ----------
    table : Table
    label : Mask [examples]
    machine : Array [examples]
        Machines stay whole in a fold.
    allowed : sequence of int
        Columns that may be read.
    first : Mask [examples], optional
        Examples whose twin was as given: they and the others are calibrated apart. None: all together.
    counted : Mask [examples], optional
        Examples to learn from and to calibrate on; the others are only asked about. None: all.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    counted = np.ones(len(label), bool) if counted is None else counted
    if min(label[counted].sum(), (~label[counted]).sum()) < _FEWEST:
        return None
    own_columns = table.take(counted).telling(label[counted].astype(float), allowed)
    if own_columns.size == 0:
        return None
    own, fold = table.values[:, own_columns], folds(machine)
    unseen, models = np.zeros(len(label)), []
    for k in range(FOLDS):
        inside, outside = counted & (fold != k), fold == k
        model = HistGradientBoostingClassifier(
            max_iter=130, learning_rate=0.08, max_leaf_nodes=14, min_samples_leaf=12, l2_regularization=2.0,
            max_features=0.2, early_stopping=False, random_state=k,
        )  # fmt: skip
        model.fit(own[inside], label[inside])
        unseen[outside] = model.decision_function(own[outside])
        models.append(Boosted.of(model))
    first = np.ones(len(label), bool) if first is None else first
    early, late = first & counted, ~first & counted
    line = _platt(unseen[early], label[early])
    line_later = line if label[late].sum() < _FEWEST else _platt(unseen[late], label[late])
    calibrated = np.where(first, line[0] * unseen + line[1], line_later[0] * unseen + line_later[1])
    return Ensemble(own_columns, models, line, line_later, calibrated)


def learn_estimator(table: Table, value: Array, machine: NDArray[np.int64], allowed: Sequence[int]) -> Estimator | None:
    """How to read a parameter off the features; `value` is NaN where the effect is absent."""
    known = np.isfinite(value)
    if known.sum() < _FEWEST or np.ptp(value[known]) == 0:
        return None
    table, value, machine = table.take(known), value[known], machine[known]
    own_columns, features = table.telling(value, allowed), table.values
    if own_columns.size == 0:
        return None
    middle = float(np.median(value))
    anchors = _anchors(features, own_columns, value)
    residual = value - _on_lines(features, anchors, middle)
    own, fold = features[:, own_columns], folds(machine)
    models, unseen = _regressed(
        own, residual, fold, loss="absolute_error", max_iter=100, max_leaf_nodes=10, min_samples_leaf=8,
        l2_regularization=1.0,
    )  # fmt: skip
    # A line that is exact for most machines is not improved by trees that make all of them a little wrong.
    with_trees, alone = np.abs(residual - unseen), np.abs(residual)
    better = np.median(with_trees) + 0.2 * with_trees.mean() < np.median(alone) + 0.2 * alone.mean()
    off = with_trees if better else alone
    error = float(np.quantile(off, 0.9))
    rest = Ensemble(own_columns, models, unseen=unseen) if better else None
    return Estimator(anchors, middle, rest, error, *_doubt(own_columns, own, off, error, fold))


def _doubt(
    columns: NDArray[np.int64], own: NDArray[np.float32], off: Array, error: float, fold: NDArray[np.int64]
) -> tuple[Ensemble | None, float]:
    """What tells how far an estimate is off, and the factor within which nine of ten machines not learnt from lie.

    Conformal regression of errors scaled by what is expected of them (Papadopoulos et al. 2011,
    doi:10.1613/jair.3198).
    """
    if error <= 0:
        return None, 1.0
    size = np.log(np.maximum(off, _LEAST_OFF * error))
    models, unseen = _regressed(
        own, size, fold, max_iter=40, max_leaf_nodes=6, min_samples_leaf=15, l2_regularization=2.0
    )
    return Ensemble(columns, models, unseen=unseen), float(np.quantile(off / np.exp(unseen), 0.9))


def _regressed(
    own: NDArray[np.float32], target: Array, fold: NDArray[np.int64], **options: Any
) -> tuple[list[Boosted], Array]:
    """Trees that say a number, one model a fold, and what each says of the examples that it has not seen."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    unseen, models = np.zeros(len(target)), []
    for k in range(FOLDS):
        inside = fold != k
        model = HistGradientBoostingRegressor(
            learning_rate=0.08, max_features=0.5, early_stopping=False, random_state=k, **options
        )
        model.fit(own[inside], target[inside])
        unseen[~inside] = model.predict(own[~inside])
        models.append(Boosted.of(model))
    return models, unseen


def _anchors(features: NDArray[np.float32], columns: NDArray[np.int64], value: Array) -> tuple[Anchor, ...]:
    """The column whose line, over it or its logarithm, comes nearest to the value for machines of which it is known,
    and the one that does for most machines.

    A comb that is found tells a gear's teeth exactly, and is not always found; another feature is always there, and
    tells them within a harmonic.
    """
    spread = float(np.mean(np.abs(value - np.median(value))))
    middle = Anchor(int(columns[0]), False, (0.0, float(np.median(value))))
    exact, usual = (1.2 * spread, middle), (1.2 * spread, middle)
    for j in columns:
        column = features[:, j].astype(float)
        known = np.isfinite(column)
        if known.mean() < 0.4 or np.std(column[known]) < 1e-9:
            continue
        for logarithmic in (False, True):
            if logarithmic and (column[known] <= 0).any():
                continue
            x, y = (np.log(column[known]) if logarithmic else column[known]), value[known]
            line = _robust_line(x, y)
            if line is None:
                continue
            off = np.full(len(value), spread)
            off[known] = np.minimum(np.abs(y - line[0] * x - line[1]), 3 * spread)
            anchor = Anchor(int(j), logarithmic, line)
            exact = min(exact, (_usual_error(off[known]), anchor), key=lambda found: found[0])
            usual = min(usual, (_usual_error(off), anchor), key=lambda found: found[0])
    return tuple(dict.fromkeys((exact[1], usual[1])))


def _usual_error(off: Array) -> float:
    """Of most, and a little of all."""
    return float(np.median(off) + 0.2 * off.mean())


def _robust_line(x: Array, y: Array) -> tuple[float, float] | None:
    """Least squares on what lies near: features have wild outliers where nothing was found."""
    near = np.ones(len(x), bool)
    line = (0.0, 0.0)
    for kept in (0.8, 0.7, 0.7, 1.0):
        if near.sum() < 10 or np.std(x[near]) < 1e-9:
            return None
        slope, offset = np.polyfit(x[near], y[near], 1)
        line = (float(slope), float(offset))
        off = np.abs(y - slope * x - offset)
        near = off <= np.quantile(off, kept)
    return line


def _platt(score: Array, label: Mask) -> tuple[float, float]:
    """Slope and offset that make scores log odds."""
    from sklearn.linear_model import LogisticRegression

    fit = LogisticRegression(C=10.0).fit(np.clip(score, -15, 15)[:, None], label)
    return max(float(fit.coef_[0, 0]), 0.05), float(fit.intercept_[0])
