"""Metrics of predicted remaining life against the true one.

Rows are in order of time, the last nearest to the end of life, and remaining life is in any one unit. A row without a
prediction (NaN) counts as a miss where hits are counted, and is left out of means. Sources: Saxena, Celaya, Saha, Saha,
Goebel 2010, Metrics for offline evaluation of prognostic performance, International Journal of Prognostics and Health
Management 1 (1), DOI 10.36001/ijphm.2010.v1i1.1336; Nectoux et al. 2012, PRONOSTIA: an experimental platform for
bearings accelerated degradation tests, IEEE PHM, hal-00719503.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from papers.arrays import Array
from twingap import TwingapError


class Coverage(NamedTuple):
    """How often the truth lay within the interval, and how wide that was."""

    share: float
    mean_width: float
    rows: int


def rmse(true: ArrayLike, predicted: ArrayLike) -> float:
    """Root of the mean squared error over rows with a prediction, unit of remaining life; NaN without any."""
    t, p = _pair(true, predicted)
    return float(np.sqrt(_mean((p - t) ** 2)))


def relative_accuracy(true: ArrayLike, predicted: ArrayLike) -> Array:
    """1 - |true - predicted| / true [rows]: 1 at best, without a lower bound; NaN at the end of life."""
    t, p = _pair(true, predicted)
    alive = t > 0
    return np.where(alive, 1 - np.abs(t - p) / np.where(alive, t, 1.0), np.nan)


def cumulative_relative_accuracy(true: ArrayLike, predicted: ArrayLike) -> float:
    """Mean of `relative_accuracy` over rows that have one, all weighing the same; NaN without any."""
    return _mean(relative_accuracy(true, predicted))


def within_alpha(true: ArrayLike, predicted: ArrayLike, alpha: float = 0.2) -> NDArray[np.bool_]:
    """Whether each prediction lies within (1 -+ alpha) of the true remaining life [rows]: the cone of alpha-lambda."""
    t, p = _pair(true, predicted)
    return np.asarray(np.abs(p - t) <= alpha * t)


def alpha_lambda(true: ArrayLike, predicted: ArrayLike, lam: float = 0.5, alpha: float = 0.2) -> bool:
    """Whether the last prediction not after t_lambda = t_P + lam (t_EoL - t_P), t_P the first row with one, lies within
    the cone; False without any."""
    t, p = _pair(true, predicted)
    made = np.flatnonzero(np.isfinite(p))
    if made.size == 0:
        return False
    t, p = t[made[0] :], p[made[0] :]
    # True remaining life falls from t_EoL - t_P to 0 as time goes on.
    row = int(np.flatnonzero(t >= (1 - lam) * t[0] - 1e-9 * t[0])[-1])
    return bool(within_alpha(t, p, alpha)[row])


def prognostic_horizon(true: ArrayLike, predicted: ArrayLike, life: float, alpha: float = 0.1) -> float:
    """Remaining life at the first row from which on all predictions lie within true -+ alpha `life` (t_EoL); 0 without
    one. The source asks for that row alone, which one lucky prediction satisfies."""
    t, p = _pair(true, predicted)
    lasting = np.logical_and.accumulate((np.abs(p - t) <= alpha * life)[::-1])[::-1]
    first = np.flatnonzero(lasting)
    return float(t[first[0]]) if first.size else 0.0


def phm2012_accuracy(true: ArrayLike, predicted: ArrayLike) -> Array:
    """A_i of the IEEE PHM 2012 challenge [rows]: 1 at best, 0 without a prediction; NaN at the end of life itself.

    With Er = 100 (true - predicted) / true, in per cent, A = exp(-ln(0.5) Er / 5) when Er <= 0 (a failure that comes
    before it was foretold) and exp(+ln(0.5) Er / 20) when Er > 0: half for 5 % too late or 20 % too early.
    """
    t, p = _pair(true, predicted)
    alive = t > 0
    error = 100 * (t - p) / np.where(alive, t, 1.0)
    score = np.where(error <= 0, 0.5 ** (-np.minimum(error, 0.0) / 5), 0.5 ** (np.maximum(error, 0.0) / 20))
    return np.where(alive, np.where(np.isfinite(p), score, 0.0), np.nan)


def phm2012_score(true: ArrayLike, predicted: ArrayLike) -> float:
    """Mean of `phm2012_accuracy`; the challenge took one prediction of each of eleven bearings (winner: about 0.31)."""
    return _mean(phm2012_accuracy(true, predicted))


def coverage(true: ArrayLike, low: ArrayLike, high: ArrayLike) -> Coverage:
    """Share of rows with an interval (not NaN; its end may be infinite) that holds the truth, and its mean width."""
    (t, lo), (_, hi) = _pair(true, low), _pair(true, high)
    given = ~np.isnan(lo) & ~np.isnan(hi)
    if not given.any():
        return Coverage(float("nan"), float("nan"), 0)
    t, lo, hi = t[given], lo[given], hi[given]
    return Coverage(float(np.mean((lo <= t) & (t <= hi))), float(np.mean(hi - lo)), int(given.sum()))


def _mean(each: Array) -> float:
    kept = each[np.isfinite(each)]
    return float(kept.mean()) if kept.size else float("nan")


def _pair(true: ArrayLike, predicted: ArrayLike) -> tuple[Array, Array]:
    """Both as arrays of one length, the truth finite and not negative."""
    t, p = np.atleast_1d(np.asarray(true, float)), np.atleast_1d(np.asarray(predicted, float))
    if t.ndim != 1 or t.shape != p.shape:
        raise TwingapError(f"{t.shape} true and {p.shape} predicted lives, one of each per row expected", where="rows")
    if not np.isfinite(t).all() or (t < 0).any():
        raise TwingapError("a true remaining life is negative or not finite", where="rows")
    return t, p
