"""Score calibration: probabilities that effects are missing, from outcomes of searches.

searches on machines not trained on --outcome of every effect--> logistic regression --> ScoreCalibration
                                    --cross-validated probabilities--> limit from which an effect is named
outcome of every effect of a new search --ScoreCalibration--> probability that it is missing

Detectors are calibrated on single evaluations. A search evaluates them repeatedly and selects the strongest effects: a
named effect is more probable than its last log odds indicate, and so are effects that were not named where a rest
remains or many effects are missing. Both relations are learnt from searches on machines that no detector was
trained on (stacking: Wolpert 1992, doi:10.1016/S0893-6080(05)80023-1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array

Mask = NDArray[np.bool_]

_FEWEST: Final = 25
"""Smallest number of missing and of absent effects from which a calibration is learnt. Fewer make it less certain."""
_FIRM: Final = 1.0
"""Inverse strength of the L2 penalty on weights. A smaller value shrinks weights."""
_LEAST_P: Final = 0.005
"""Smallest p-value; smaller ones are clipped, because the null distribution does not resolve them."""
_MOST_ODDS: Final = 9.0
"""Largest absolute log odds; larger ones are clipped."""
FALSE: Final = 0.08
"""Largest part of named effects that may be false on machines like those trained on. It is below the target of a
tenth as a margin for other machines. A larger value names more effects."""
_LIMITS: Final = np.arange(0.5, 0.91, 0.025)
"""Candidate limits from which an effect is named."""
_PARTS: Final = 10
"""Folds of the cross-validation. A larger number takes longer."""


class Outcome(NamedTuple):
    """Outcome of a search for one effect."""

    # Log odds: of a named effect with that effect left out, of any other against the twin with all named effects.
    certainty: float
    first: float  # log odds against the twin as given
    named: bool
    others: int  # number of named effects
    p_value: float  # p-value of no gap
    rest_p: float  # p-value of no rest

    def features(self) -> Array:
        """[9] Inputs of the calibration."""
        certainty, first = np.clip((self.certainty, self.first), -_MOST_ODDS, _MOST_ODDS)
        rest, gap = (np.log(max(p, _LEAST_P)) for p in (self.rest_p, self.p_value))
        own, other = float(self.named), float(not self.named)
        return np.array([
            own, own * certainty, own * first, own * rest,
            other * certainty, other * first, other * rest, other * gap, other * self.others,
        ])  # fmt: skip


@dataclass(frozen=True)
class ScoreCalibration:
    """Logistic regression: log odds that an effect is missing, linear in the features of its outcome.

    From the probability `named_from` on an effect is named.
    """

    weights: Array
    offset: float
    named_from: float

    def probability(self, outcome: Outcome) -> float:
        """Probability that this effect is missing."""
        return float(1 / (1 + np.exp(-(self.weights @ outcome.features() + self.offset))))


def learn_score_calibration(
    outcomes: Sequence[Outcome], missing: Sequence[bool], machine: Sequence[int]
) -> ScoreCalibration | None:
    """Score calibration from outcomes of searches, of effects known to be missing or not; None where there are too few.

    `machine` is the machine, or group of machines, of each outcome; in cross-validation a group is never split.
    """
    label = np.asarray(missing, bool)
    if min(label.sum(), (~label).sum()) < _FEWEST:
        return None
    table = np.array([outcome.features() for outcome in outcomes])
    part = np.unique(machine, return_inverse=True)[1] % _PARTS
    probability = np.full(label.size, np.nan)
    for k in np.unique(part):
        others = part != k
        if 0 < label[others].sum() < others.sum():
            weights, offset = _fitted(table[others], label[others])
            probability[~others] = 1 / (1 + np.exp(-(table[~others] @ weights + offset)))
    return ScoreCalibration(*_fitted(table, label), _limit(probability, label))


def _fitted(table: Array, label: Mask) -> tuple[Array, float]:
    """Weights [features] and offset of a logistic regression."""
    from sklearn.linear_model import LogisticRegression

    scale = np.maximum(table.std(axis=0), 1e-9)
    fit = LogisticRegression(C=_FIRM, max_iter=2000).fit(table / scale, label)
    return fit.coef_[0] / scale, float(fit.intercept_[0])


def _limit(probability: Array, label: Mask) -> float:
    """The smallest probability from which at most `FALSE` of the named effects are false."""
    for limit in _LIMITS:
        named = probability >= limit
        if not named.any() or (~label[named]).mean() <= FALSE:
            return float(limit)
    return float(_LIMITS[-1])
