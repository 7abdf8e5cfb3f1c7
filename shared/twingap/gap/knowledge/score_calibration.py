"""What the end of a search is worth: its log odds turned into probabilities that hold.

searches on machines not learnt from --outcome of every effect--> logistic regression --> ScoreCalibration
                                     --each judged by the others--> how probable an effect has to be to be named
outcome of every effect of a new search --ScoreCalibration--> probability that it is missing

Detectors are calibrated on first looks. A search asks them again and again, names the strongest, and stops: what it
has named is likelier than its last log odds say, and beside a rest that nothing explains, or among many effects, what
it has not named is not as unlikely. Both are learnt from whole searches, on machines that no detector has learnt from
(stacking: Wolpert 1992, doi:10.1016/S0893-6080(05)80023-1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FEWEST: Final = 25
"""Effects of either kind, missing or not, below which nothing is learnt."""
_FIRM: Final = 1.0
"""Inverse strength of the ridge on weights."""
_LEAST_P: Final = 0.005
"""P-values below are all the same: no smaller ones can come of the machines that they are ranked among."""
_MOST_ODDS: Final = 9.0
FALSE: Final = 0.06
"""Part of what is named that may be false on machines like those learnt from: less than the tenth that is promised, as
in blind studies up to twice as many were."""
_LIMITS: Final = np.arange(0.6, 0.91, 0.025)
_PARTS: Final = 10


class Outcome(NamedTuple):
    """What a search ended with for one effect.

    Parameters
    ----------
    certainty : float
        Log odds: of a named one when it alone is left out, of another against the twin with all that is named.
    first : float
        Log odds against the twin as given.
    named : bool
    others : int
        Number of effects named.
    p_value : float
        Of no gap.
    rest_p : float
        Of nothing left over.
    """

    certainty: float
    first: float
    named: bool
    others: int
    p_value: float
    rest_p: float

    def features(self) -> Array:
        """[9] What its probability is worked out from."""
        certainty, first = np.clip((self.certainty, self.first), -_MOST_ODDS, _MOST_ODDS)
        rest, whole = (np.log(max(p, _LEAST_P)) for p in (self.rest_p, self.p_value))
        own, other = float(self.named), float(not self.named)
        return np.array([
            own, own * certainty, own * first, own * rest,
            other * certainty, other * first, other * rest, other * whole, other * self.others,
        ])  # fmt: skip


@dataclass(frozen=True)
class ScoreCalibration:
    """Log odds that an effect is missing, linear in its outcome's features.

    Parameters
    ----------
    weights : Array [features]
    offset : float
    named_from : float
        Probability from which an effect is named.
    """

    weights: Array
    offset: float
    named_from: float

    def probability(self, outcome: Outcome) -> float:
        """That this effect is missing."""
        return float(1 / (1 + np.exp(-(self.weights @ outcome.features() + self.offset))))


def learn_score_calibration(
    outcomes: Sequence[Outcome], missing: Sequence[bool], machine: Sequence[int]
) -> ScoreCalibration | None:
    """From outcomes of searches whose truth is known; None where they are too few.

    Parameters
    ----------
    outcomes : sequence of Outcome
    missing : sequence of bool
    machine : sequence of int
        Which machine (or which few of them) each outcome is of, so that none is judged by what was learnt from itself.
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
    """Weights and offset of a logistic regression."""
    from sklearn.linear_model import LogisticRegression

    scale = np.maximum(table.std(axis=0), 1e-9)
    fit = LogisticRegression(C=_FIRM, max_iter=2000).fit(table / scale, label)
    return fit.coef_[0] / scale, float(fit.intercept_[0])


def _limit(probability: Array, label: Mask) -> float:
    """The least limit from which no more than `FALSE` of what is named is false."""
    for limit in _LIMITS:
        named = probability >= limit
        if not named.any() or (~label[named]).mean() <= FALSE:
            return float(limit)
    return float(_LIMITS[-1])
