"""Detection of the first anomaly of a run: normalised amplitude leaves the scatter of its healthy beginning.

rows 0 .. n-1 (healthy) --> limit -------+
rows n, n+1, ... ------------------------+--> above it, `consecutive` rows together? --> K_anomaly

Paper 1 (section 3.3) takes mean and standard deviation of the beginning "as the threshold", without saying how many
deviations. Here their number follows from a stated chance of a false alarm over a stated number of rows, and allows for
the limit being an estimate. With law "normal" it follows from the normal law; but peak to peak is an extreme and has a
long upper tail: of simulated runs with Gumbel scatter 12 % gave an alarm where 1 % was stated (60 healthy rows, 2,000
later ones, 3 together). By default, law "any", the limit is one of the greatest healthy rows, for which the chance is
known whatever the law.
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
    """When amplitude counts as no longer healthy.

    Parameters
    ----------
    false_alarm : float
        Chance of an alarm within `horizon_rows` healthy rows, between 0 and 0.5.
    horizon_rows : int
        Rows after the reference for which that holds. A fixed number, and not the run's length, which is not known
        while the machine runs.
    consecutive : int
        Rows that must lie above the limit together.
    law : {"any", "normal"}
        Of healthy amplitudes about their mean.
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
    """What the rule found.

    Parameters
    ----------
    limit : float
        Normalised amplitude above which a row counts.
    mean, std : float
        Of the reference.
    onset_row : int or None
        K_anomaly: first of the rows above the limit together, counted from the run's first row, 0. None: no anomaly.
    alarm_row : int or None
        Last of them: the row with which the anomaly is known.
    """

    limit: float
    mean: float
    std: float
    onset_row: int | None = None
    alarm_row: int | None = None


def detect_anomaly(
    normalised: ArrayLike, reference_rows: int, rule: AnomalyRule | None = None, *, speeds: int = 1
) -> Anomaly:
    """Find K_anomaly in normalised peak to peak (eq. 11).

    Parameters
    ----------
    normalised : array_like [rows]
        In order of time. NaN (a stopped machine) neither counts nor breaks a sequence.
    reference_rows : int
        Rows at the beginning that are taken to be healthy: [t0, t1] of figure 5. No alarm is given within them.
    rule : AnomalyRule, optional
    speeds : int
        Speeds whose constants c were learnt from the reference rows themselves (`SpeedInfluence.speeds_rpm.size`):
        each takes away a degree of freedom, as a mean does.

    Returns
    -------
    Anomaly
        Depends on no row after `alarm_row`.

    Raises
    ------
    TwingapError
        When the reference is too short for what the rule promises, or does not scatter at all.
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
                f"{healthy.size} healthy rows cannot promise {rule.false_alarm:g} false alarms", where="reference",
                mend="take more healthy rows, or more consecutive ones",
            )  # fmt: skip
        # Rows are nearer to constants learnt from them than later rows will be, and the rows of a sequence at one speed
        # share its constant's error: the first is undone, and what the second costs under the normal law is added.
        wider = float(np.sqrt((healthy.size - 1) / free))
        higher = deviations(healthy.size, speeds, rule) - deviations(healthy.size, 1, rule) if speeds > 1 else 0.0
        limit = mean + float(np.sort(healthy)[-place] - mean) * wider + max(higher, 0.0) * std
    later = np.flatnonzero(np.isfinite(x))
    later = later[later >= reference_rows]
    together = 0
    for place, above in enumerate(x[later] > limit):
        together = together + 1 if above else 0
        if together == rule.consecutive:
            return Anomaly(limit, mean, std, int(later[place + 1 - together]), int(later[place]))
    return Anomaly(limit, mean, std)


@lru_cache(maxsize=256)
def deviations(rows: int, fitted: int, rule: AnomalyRule) -> float:
    """Standard deviations above the mean at which the limit lies.

    Parameters
    ----------
    rows : int
        Healthy rows behind mean and deviation.
    fitted : int
        Levels estimated from them, 1 or more and fewer than `rows`.
    rule : AnomalyRule

    Returns
    -------
    float
        The number for which an independent normal sequence alarms within the horizon with the stated chance, on average
        over what mean and deviation such a reference may give. With several levels the chance is a bound, nearly
        reached when each is held for many rows. Rows that depend on one another alarm more often.
    """
    free = rows - fitted
    nodes, weights = roots_hermitenorm(41)
    level = nodes * np.sqrt(fitted / rows)
    share, worth = np.polynomial.legendre.leggauss(121)
    # u^3 crowds the nodes where the spread was underestimated: most false alarms come from there.
    u = (share + 1) / 2
    spread = np.sqrt(chi2.ppf(u**3, free) / free)
    weight = np.outer(weights / weights.sum(), worth / 2 * 3 * u**2)

    def excess(number: float) -> float:
        q = ndtr(-(level[:, None] + number * spread[None, :]))
        together = q**rule.consecutive
        begins = (1 - q) * together
        if fitted > 1:
            # Each speed's constant errs by itself, so a long run averages over their errors; a single one's stays.
            level_weight = weights[:, None] / weights.sum()
            together, begins = (np.sum(level_weight * v, axis=0, keepdims=True) for v in (together, begins))
        return float(np.sum(weight * _alarm(together, begins, rule))) - rule.false_alarm

    return float(brentq(excess, -1.0, 1e4, xtol=1e-6))


@lru_cache(maxsize=256)
def rank(rows: int, rule: AnomalyRule) -> int:
    """Which of the healthy rows, counted from the greatest (1), may be the limit; 0 when not even that one.

    The chance that a later row exceeds the r-th greatest of n is Beta(r, n - r + 1) over references, whatever the law
    of independent rows (Wilks 1941, DOI 10.1214/aoms/1177731788): over it the chance of an alarm is averaged.

    Parameters
    ----------
    rows : int
        Healthy rows n.
    rule : AnomalyRule
    """
    share, worth = np.polynomial.legendre.leggauss(121)
    v = (share + 1) / 2
    places = np.arange(1, max(rows // 2, 1) + 1)
    # v^3 crowds the nodes where the limit came out low.
    q: Array = np.asarray(beta.isf(v[None, :] ** 3, places[:, None], rows - places[:, None] + 1), float)
    together = q**rule.consecutive
    chance = np.sum(worth / 2 * 3 * v**2 * _alarm(together, (1 - q) * together, rule), axis=1)
    return int(np.searchsorted(chance, rule.false_alarm, side="right"))


def _alarm(together: Array, begins: Array, rule: AnomalyRule) -> Array:
    """Chance of a sequence above the limit within the horizon (Feller 1968, chapter XIII).

    `together` is the chance of one at the first rows, `begins` that one begins, after a row below, at any later row.
    """
    return np.asarray(1 - (1 - together) * (1 - begins) ** (rule.horizon_rows - rule.consecutive))
