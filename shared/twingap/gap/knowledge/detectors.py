"""Detectors and estimators: boosted trees for the log odds that an effect is missing, and for a parameter's value.

features [examples, columns] --selection--> trees, one model per fold of whole machines --> Ensemble, Estimator
                                            out-of-fold predictions --> calibration
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array
from twingap.trees import Trees

Mask = NDArray[np.bool_]

FOLDS: Final = 5
"""Folds of the cross-validation and models of an ensemble. A larger number takes longer."""
_KEPT: Final = 170
"""Largest number of features of a model. A larger number trains longer and admits less informative features."""
_KNOWN: Final = 0.12
"""Smallest part of the examples in which a feature has to be known to be used. A larger value uses fewer features."""
_LEAST_OFF: Final = 0.02
"""Error, as a part of the bound on nine of ten errors, below which estimates count as exact; it bounds the
logarithm."""
_FEWEST: Final = 25
"""Smallest number of examples from which a model is learnt. A larger value leaves rare effects without a model."""


@dataclass
class Ensemble:
    """One model per fold over selected features, with their out-of-fold predictions."""

    columns: NDArray[np.int64]  # [columns] selected features
    models: list[Trees]
    # Slope and offset of the calibration, for a twin as given and for one to which effects have been added.
    line: tuple[float, float] = (1.0, 0.0)
    line_later: tuple[float, float] = (1.0, 0.0)
    out_of_fold: Array = field(default_factory=lambda: np.empty(0))  # [examples] out-of-fold predictions

    def score(self, features: NDArray[Any], *, later: bool = False) -> Array:
        """[examples] Log odds of a classifier, or value of a regressor, from features [examples, features].

        `later` states that effects have been added to the twin: further ones are then less probable at the same score.
        """
        own = np.asarray(np.asarray(features)[:, self.columns], np.float32)
        slope, offset = self.line_later if later else self.line
        return np.asarray(slope * np.mean([trees(own)[:, 0] for trees in self.models], axis=0) + offset)


@dataclass(frozen=True)
class Anchor:
    """Linear function of one feature, or of its logarithm; `line` is slope and offset."""

    column: int
    logarithmic: bool
    line: tuple[float, float]

    def read(self, features: NDArray[Any]) -> Array:
        """[examples] Value of the function; NaN where the feature is unknown."""
        x = np.asarray(features[:, self.column], float)
        at = np.log(np.maximum(np.abs(x), 1e-9)) if self.logarithmic else x
        return np.where(np.isfinite(x), self.line[0] * np.where(np.isfinite(x), at, 0.0) + self.line[1], np.nan)


@dataclass
class Estimator:
    """Estimator of a parameter: a linear function of the best feature, plus trees where they reduce the error."""

    anchors: tuple[Anchor, ...]  # linear functions in order of preference; the first with a known feature is used
    default: float  # value where none of these features is known
    residual: Ensemble | None  # trees for the residual; None where they do not reduce the out-of-fold error
    error: float  # bound on nine of ten out-of-fold errors, on the scale of `parameter_scale`
    # Trees for the logarithm of the absolute error, which depends on the machine: the number of teeth, for example, is
    # either exact or unknown.
    error_model: Ensemble | None = None
    error_factor: float = 1.0  # factor on the error predicted by `error_model` that bounds nine of ten errors

    def estimate(self, features: NDArray[Any]) -> Array:
        """[examples] Comparable numbers, see `parameter_scale`."""
        line = _on_lines(features, self.anchors, self.default)
        return line if self.residual is None else line + self.residual.score(features)

    def within(self, features: NDArray[Any]) -> Array:
        """[examples] Bound on nine of ten errors of such estimates, comparable numbers."""
        if self.error_model is None:
            return np.full(len(features), self.error)
        return np.asarray(self.error_factor * np.exp(self.error_model.score(features)))


def _on_lines(features: NDArray[Any], anchors: Sequence[Anchor], middle: float) -> Array:
    """[examples] Value of the first anchor whose feature is known."""
    out = np.full(len(features), np.nan)
    for anchor in anchors:
        out = np.where(np.isfinite(out), out, anchor.read(features))
    return np.where(np.isfinite(out), out, middle)


class Table:
    """Features of examples with their ranks, which all models share."""

    def __init__(self, features: NDArray[np.float32]) -> None:
        self.values = features
        self.ranks = np.zeros_like(features)
        for j in range(features.shape[1]):
            known = np.isfinite(features[:, j])
            if known.sum() >= _FEWEST and np.ptp(features[known, j]) > 0:
                place = np.argsort(np.argsort(features[known, j])).astype(float)
                self.ranks[known, j] = (place - place.mean()) / (place.std() * np.sqrt(len(features)))

    def take(self, rows: Mask) -> Table:
        """A subset of the examples; ranks remain those among all."""
        part = Table.__new__(Table)
        part.values, part.ranks = self.values[rows], self.ranks[rows]
        return part

    def informative(self, target: Array, allowed: Sequence[int]) -> NDArray[np.int64]:
        """The most informative of the allowed columns, by rank correlation and by importance in randomised trees."""
        from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor

        own = np.asarray(allowed, int)
        # A feature that few machines have may be unknown in a whole fold.
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
    table: Table, label: Mask, machine: NDArray[np.int64], allowed: Sequence[int], first: Mask | None = None,
    counted: Mask | None = None,
) -> Ensemble | None:  # fmt: skip
    """A detector with calibrated log odds, or None where there are too few examples of either class.

    A machine is in one fold only; `allowed` are columns that may be used. Of the examples, `first` are those with the
    twin as given, calibrated separately from the others, and `counted` those for training and calibration: for the
    others, predictions are computed only. None: all examples.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    counted = np.ones(len(label), bool) if counted is None else counted
    if min(label[counted].sum(), (~label[counted]).sum()) < _FEWEST:
        return None
    own_columns = table.take(counted).informative(label[counted].astype(float), allowed)
    if own_columns.size == 0:
        return None
    own, fold = table.values[:, own_columns], machine % FOLDS
    out_of_fold, models = np.zeros(len(label)), []
    for k in range(FOLDS):
        inside, outside = counted & (fold != k), fold == k
        model = HistGradientBoostingClassifier(
            max_iter=130, learning_rate=0.08, max_leaf_nodes=14, min_samples_leaf=12, l2_regularization=2.0,
            max_features=0.2, early_stopping=False, random_state=k,
        )  # fmt: skip
        model.fit(own[inside], label[inside])
        out_of_fold[outside] = model.decision_function(own[outside])
        models.append(Trees.of_boosting(model))
    first = np.ones(len(label), bool) if first is None else first
    early, late = first & counted, ~first & counted
    line = _platt(out_of_fold[early], label[early])
    line_later = line if label[late].sum() < _FEWEST else _platt(out_of_fold[late], label[late])
    calibrated = np.where(first, line[0] * out_of_fold + line[1], line_later[0] * out_of_fold + line_later[1])
    return Ensemble(own_columns, models, line, line_later, calibrated)


def learn_estimator(table: Table, value: Array, machine: NDArray[np.int64], allowed: Sequence[int]) -> Estimator | None:
    """Estimator of a parameter from features; None where there are too few examples.

    `value` [examples] are comparable numbers, NaN where the effect is absent; others as for `learn_classifier`.
    """
    known = np.isfinite(value)
    if known.sum() < _FEWEST or np.ptp(value[known]) == 0:
        return None
    table, value, machine = table.take(known), value[known], machine[known]
    own_columns, features = table.informative(value, allowed), table.values
    if own_columns.size == 0:
        return None
    middle = float(np.median(value))
    anchors = _anchors(features, own_columns, value)
    residual = value - _on_lines(features, anchors, middle)
    own, fold = features[:, own_columns], machine % FOLDS
    models, out_of_fold = _regressed(
        own, residual, fold, loss="absolute_error", max_iter=100, max_leaf_nodes=10, min_samples_leaf=8,
        l2_regularization=1.0,
    )  # fmt: skip
    # A function that is exact for most machines must not be replaced by trees that are slightly off for all.
    with_trees, alone = np.abs(residual - out_of_fold), np.abs(residual)
    better = np.median(with_trees) + 0.2 * with_trees.mean() < np.median(alone) + 0.2 * alone.mean()
    off = with_trees if better else alone
    error = float(np.quantile(off, 0.9))
    rest = Ensemble(own_columns, models, out_of_fold=out_of_fold) if better else None
    return Estimator(anchors, middle, rest, error, *_error_model(own_columns, own, off, error, fold))


def _error_model(
    columns: NDArray[np.int64], own: NDArray[np.float32], off: Array, error: float, fold: NDArray[np.int64]
) -> tuple[Ensemble | None, float]:
    """Trees for the size of an estimate's error, and the factor that bounds nine of ten out-of-fold errors.

    Conformal regression with normalised errors (Papadopoulos et al. 2011, doi:10.1613/jair.3198).
    """
    if error <= 0:
        return None, 1.0
    size = np.log(np.maximum(off, _LEAST_OFF * error))
    models, out_of_fold = _regressed(
        own, size, fold, max_iter=40, max_leaf_nodes=6, min_samples_leaf=15, l2_regularization=2.0
    )
    return Ensemble(columns, models, out_of_fold=out_of_fold), float(np.quantile(off / np.exp(out_of_fold), 0.9))


def _regressed(
    own: NDArray[np.float32], target: Array, fold: NDArray[np.int64], **options: Any
) -> tuple[list[Trees], Array]:
    """Regression trees, one model per fold, and their out-of-fold predictions [examples]."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    out_of_fold, models = np.zeros(len(target)), []
    for k in range(FOLDS):
        inside = fold != k
        model = HistGradientBoostingRegressor(
            learning_rate=0.08, max_features=0.5, early_stopping=False, random_state=k, **options
        )
        model.fit(own[inside], target[inside])
        if not inside.all():  # few machines with this parameter may leave a fold empty
            out_of_fold[~inside] = model.predict(own[~inside])
        models.append(Trees.of_boosting(model))
    return models, out_of_fold


def _anchors(features: NDArray[np.float32], columns: NDArray[np.int64], value: Array) -> tuple[Anchor, ...]:
    """Linear functions with the smallest error: over machines with a known feature, and over all machines.

    A comb, where it is found, gives a gear's number of teeth exactly; another feature is always known and gives it to
    within a harmonic.
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
    """Typical error: the median, plus a part of the mean."""
    return float(np.median(off) + 0.2 * off.mean())


def _robust_line(x: Array, y: Array) -> tuple[float, float] | None:
    """Slope and offset of trimmed least squares: features have outliers where nothing was detected."""
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
    """Slope and offset of Platt scaling, which turns scores into log odds."""
    from sklearn.linear_model import LogisticRegression

    fit = LogisticRegression(C=10.0).fit(np.clip(score, -15, 15)[:, None], label)
    return max(float(fit.coef_[0, 0]), 0.05), float(fit.intercept_[0])
