"""Detection of the first anomaly of a run: normalised amplitude exceeds the scatter of its healthy beginning.

rows 0 .. n-1 (healthy) --> limit -------+
rows n, n+1, ... ------------------------+--> `consecutive` rows above the limit? --> K_anomaly

Paper 1 (section 3.3) takes mean and standard deviation of the beginning "as the threshold", without the number of
deviations. Here it follows from the probability of a false alarm over a number of rows, with allowance for the limit
being an estimate. Law "normal" assumes normal amplitudes; peak to peak is an extreme value with a long upper tail, so
that false alarms are then much more frequent than stated. With the default law "any", the limit is one of the largest
healthy rows, for which the probability is known for every continuous distribution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import ndtr, roots_hermitenorm
from scipy.stats import beta, chi2

from twingap.errors import TwingapError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AnomalyRule:
    """Rule for an alarm: false-alarm probability, horizon, number of consecutive rows, distribution.

    Parameters
    ----------
    false_alarm : float
        Probability of an alarm within `horizon_rows` healthy rows, between 0 and 0.5.
    horizon_rows : int
        Rows after the reference for which that holds. It is fixed, since the length of the run is unknown while the
        machine runs.
    consecutive : int
        Number of consecutive rows above the limit that give an alarm.
    law : {"any", "normal"}
        Distribution of healthy amplitudes about their mean.
    """

    false_alarm: float = 0.01
    horizon_rows: int = 2000
    consecutive: int = 5
    law: Literal["any", "normal"] = "any"

    def __post_init__(self) -> None:
        if not 0 < self.false_alarm < 0.5:
            raise TwingapError(f"false_alarm = {self.false_alarm!r}, between 0 and 0.5 expected", where="anomaly rule")
        if self.consecutive < 1 or self.horizon_rows < self.consecutive:
            raise TwingapError(
                f"{self.consecutive} consecutive of {self.horizon_rows} rows, 1 or more of at least as many expected",
                where="anomaly rule",
            )


@dataclass(frozen=True)
class Anomaly:
    """Limit of the anomaly, and the anomaly if there is one.

    Parameters
    ----------
    limit : float
        Normalised amplitude above which a row counts towards an anomaly.
    mean, std : float
        Mean and standard deviation of the reference.
    onset_row : int or None
        K_anomaly: first of the consecutive rows above the limit, counted from 0. None: no anomaly.
    alarm_row : int or None
        Last of them: the row at which the alarm is given.
    """

    limit: float
    mean: float
    std: float
    onset_row: int | None = None
    alarm_row: int | None = None


def detect_anomaly(
    normalised: ArrayLike, reference_rows: int, rule: AnomalyRule | None = None, *, speeds: int = 1
) -> Anomaly:
    """K_anomaly of normalised peak to peak (eq. 11).

    Parameters
    ----------
    normalised : array_like [rows]
        Normalised amplitude in order of time. NaN (a stopped machine) neither counts nor interrupts a sequence.
    reference_rows : int
        First rows, assumed healthy: [t0, t1] of figure 5. No alarm is given within them.
    rule : AnomalyRule, optional
    speeds : int
        Number of speeds whose constants c were estimated from the reference rows (`SpeedInfluence.speeds_rpm.size`).
        Each removes a degree of freedom, as a mean does.

    Returns
    -------
    Anomaly
        It does not depend on rows after `alarm_row`.

    Raises
    ------
    TwingapError
        When the reference is too short for the rule, or has no scatter.
    """
    rule = rule or AnomalyRule()
    x = np.asarray(normalised, float)
    healthy = x[:reference_rows][np.isfinite(x[:reference_rows])]
    free = healthy.size - speeds
    if free < 4:
        raise TwingapError(
            f"{healthy.size} healthy rows at {speeds} speeds", where="reference",
            mend=f"take at least {speeds + 4} rows of the running machine as reference",
        )  # fmt: skip
    mean = float(healthy.mean())
    std = float(np.sqrt(np.sum((healthy - mean) ** 2) / free))
    if std <= 1e-12 * abs(mean):
        raise TwingapError("all rows are equal", where="reference", mend="give measured amplitudes")
    if rule.law == "normal":
        limit = mean + deviations(healthy.size, speeds, rule) * std
    else:
        place = rank(healthy.size, rule)
        if place == 0:
            raise TwingapError(
                f"{healthy.size} healthy rows are too few for {rule.false_alarm:g} false alarms", where="reference",
                mend="take more healthy rows, or more consecutive ones",
            )  # fmt: skip
        # Reference rows deviate less than later rows from constants estimated from them, which the first factor
        # corrects. Consecutive rows at one speed share its constant's error; the second term is the cost under
        # normality.
        wider = float(np.sqrt((healthy.size - 1) / free))
        higher = deviations(healthy.size, speeds, rule) - deviations(healthy.size, 1, rule) if speeds > 1 else 0.0
        limit = mean + float(np.sort(healthy)[-place] - mean) * wider + max(higher, 0.0) * std
    later = np.flatnonzero(np.isfinite(x))
    later = later[later >= reference_rows]
    consecutive = 0
    for place, above in enumerate(x[later] > limit):
        consecutive = consecutive + 1 if above else 0
        if consecutive == rule.consecutive:
            return Anomaly(limit, mean, std, int(later[place + 1 - consecutive]), int(later[place]))
    return Anomaly(limit, mean, std)


@lru_cache(maxsize=256)
def deviations(rows: int, fitted: int, rule: AnomalyRule) -> float:
    """Number of standard deviations from the mean to the limit, under the normal law.

    Parameters
    ----------
    rows : int
        Healthy rows from which mean and deviation are estimated.
    fitted : int
        Number of levels estimated from them, from 1 to `rows` - 1.
    rule : AnomalyRule

    Returns
    -------
    float
        Number for which an independent normal sequence gives an alarm within the horizon with the stated probability,
        averaged over the sampling distribution of mean and deviation. With several levels the probability is an upper
        bound, nearly reached when each is held for many rows. Correlated rows give more alarms.
    """
    free = rows - fitted
    nodes, weights = roots_hermitenorm(41)
    level = nodes * np.sqrt(fitted / rows)
    share, worth = np.polynomial.legendre.leggauss(121)
    # u^3 concentrates the nodes where the spread is underestimated, where most false alarms occur.
    u = (share + 1) / 2
    spread = np.sqrt(chi2.ppf(u**3, free) / free)
    weight = np.outer(weights / weights.sum(), worth / 2 * 3 * u**2)

    def excess(number: float) -> float:
        q = ndtr(-(level[:, None] + number * spread[None, :]))
        together = q**rule.consecutive
        begins = (1 - q) * together
        if fitted > 1:
            # Constants of several speeds have independent errors, over which a long run averages.
            level_weight = weights[:, None] / weights.sum()
            together, begins = (np.sum(level_weight * v, axis=0, keepdims=True) for v in (together, begins))
        return float(np.sum(weight * _alarm(together, begins, rule))) - rule.false_alarm

    return float(brentq(excess, -1.0, 1e4, xtol=1e-6))


@lru_cache(maxsize=256)
def rank(rows: int, rule: AnomalyRule) -> int:
    """Rank of the healthy row that is the limit, counted from the largest (1); 0 when no rank keeps the probability.

    The probability that a later row exceeds the r-th largest of n has the distribution Beta(r, n - r + 1) for every
    continuous law of independent rows (Wilks 1941, DOI 10.1214/aoms/1177731788). The probability of an alarm is
    averaged over it.

    Parameters
    ----------
    rows : int
        Number n of healthy rows.
    rule : AnomalyRule
    """
    share, worth = np.polynomial.legendre.leggauss(121)
    v = (share + 1) / 2
    places = np.arange(1, max(rows // 2, 1) + 1)
    # v^3 concentrates the nodes where the limit is low.
    q: Array = np.asarray(beta.isf(v[None, :] ** 3, places[:, None], rows - places[:, None] + 1), float)
    together = q**rule.consecutive
    chance = np.sum(worth / 2 * 3 * v**2 * _alarm(together, (1 - q) * together, rule), axis=1)
    return int(np.searchsorted(chance, rule.false_alarm, side="right"))


def _alarm(together: Array, begins: Array, rule: AnomalyRule) -> Array:
    """Probability of a sequence above the limit within the horizon (Feller 1968, chapter XIII).

    `together` is the probability of one at the first rows, `begins` that one begins at a later row, after one below.
    """
    return np.asarray(1 - (1 - together) * (1 - begins) ** (rule.horizon_rows - rule.consecutive))
