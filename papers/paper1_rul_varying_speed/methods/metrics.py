"""Metrics of predicted remaining life against the true one.

true remaining life [rows], predicted [rows], interval [rows, 2] --> RMSE, alpha-lambda, relative accuracy, horizon,
                                                                     score of the PHM 2012 challenge, coverage

Rows are in order of time, the last nearest to the end of life. Remaining life may be in any one unit. A row without a
prediction (NaN) counts as a miss where hits are counted, and is left out of means, which say how many rows they are of.
Sources: Saxena, Celaya, Saha, Saha, Goebel 2010, Metrics for offline evaluation of prognostic performance,
International Journal of Prognostics and Health Management 1 (1), DOI 10.36001/ijphm.2010.v1i1.1336; Nectoux et al.
2012, PRONOSTIA: an experimental platform for bearings accelerated degradation tests, IEEE PHM, hal-00719503.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError

Array = NDArray[np.float64]


class Coverage(NamedTuple):
    """How often the truth lay within the interval, and how wide that was."""

    share: float
    mean_width: float
    rows: int


def rmse(true: ArrayLike, predicted: ArrayLike) -> float:
    """Root of the mean squared error over rows with a prediction, unit of remaining life; NaN without any."""
    t, p = _pair(true, predicted)
    kept = np.isfinite(p)
    return float(np.sqrt(np.mean((p[kept] - t[kept]) ** 2))) if kept.any() else float("nan")


def relative_accuracy(true: ArrayLike, predicted: ArrayLike) -> Array:
    """1 - |true - predicted| / true of each row (Saxena et al. 2010).

    Returns
    -------
    Array [rows]
        1 at best, without a lower bound; NaN at the end of life itself and without a prediction.
    """
    t, p = _pair(true, predicted)
    alive = t > 0
    return np.where(alive, 1 - np.abs(t - p) / np.where(alive, t, 1.0), np.nan)


def cumulative_relative_accuracy(true: ArrayLike, predicted: ArrayLike) -> float:
    """Mean of `relative_accuracy` over rows that have one, all weighing the same; NaN without any."""
    each = relative_accuracy(true, predicted)
    kept = each[np.isfinite(each)]
    return float(kept.mean()) if kept.size else float("nan")


def within_alpha(true: ArrayLike, predicted: ArrayLike, alpha: float = 0.2) -> NDArray[np.bool_]:
    """Whether each prediction lies within (1 -+ alpha) of the true remaining life: the cone of alpha-lambda.

    Parameters
    ----------
    true, predicted : array_like [rows]
    alpha : float
        Above 0.

    Returns
    -------
    NDArray[bool] [rows]
        False without a prediction.
    """
    t, p = _pair(true, predicted)
    _positive(alpha, "alpha")
    return np.asarray(np.abs(p - t) <= alpha * t)


def alpha_lambda(true: ArrayLike, predicted: ArrayLike, lam: float = 0.5, alpha: float = 0.2) -> bool:
    """Alpha-lambda accuracy: whether the prediction at t_lambda lies within the cone.

    Parameters
    ----------
    true, predicted : array_like [rows]
        From the first prediction t_P on: rows before the first finite prediction are left out.
    lam : float
        0 at t_P, 1 at the end of life.

    Returns
    -------
    bool
        Of the last row not after t_lambda = t_P + lam (t_EoL - t_P). False when nothing was predicted.
    """
    t, p = _pair(true, predicted)
    if not 0 <= lam <= 1:
        raise TwingapError(f"lambda = {lam!r}, 0 to 1 expected", where="alpha-lambda")
    made = np.flatnonzero(np.isfinite(p))
    if made.size == 0:
        return False
    t, p = t[made[0] :], p[made[0] :]
    # True remaining life falls from t_EoL - t_P to 0 as time goes on.
    row = int(np.flatnonzero(t >= (1 - lam) * t[0] - 1e-9 * t[0])[-1])
    return bool(within_alpha(t, p, alpha)[row])


def prognostic_horizon(true: ArrayLike, predicted: ArrayLike, life: float, alpha: float = 0.1) -> float:
    """How long before its end a life was foretold for good within alpha of its length (Saxena et al. 2010).

    Parameters
    ----------
    true, predicted : array_like [rows]
    life : float
        t_EoL, unit of remaining life: the bounds are true -+ alpha t_EoL, the same in every row.

    Returns
    -------
    float
        Remaining life at the first row from which on all lie within the bounds; 0 when there is none. The source asks
        for that row alone, which one lucky prediction satisfies.
    """
    t, p = _pair(true, predicted)
    _positive(alpha, "alpha")
    _positive(life, "life")
    lasting = np.logical_and.accumulate((np.abs(p - t) <= alpha * life)[::-1])[::-1]
    first = np.flatnonzero(lasting)
    return float(t[first[0]]) if first.size else 0.0


def phm2012_accuracy(true: ArrayLike, predicted: ArrayLike) -> Array:
    """A_i of the IEEE PHM 2012 challenge, for each prediction.

    With Er = 100 (true - predicted) / true, in per cent, A = exp(-ln(0.5) Er / 5) when Er <= 0 (a failure that comes
    before it was foretold) and exp(+ln(0.5) Er / 20) when Er > 0: half for 5 % too late or 20 % too early (Nectoux et
    al. 2012).

    Returns
    -------
    Array [rows]
        1 at best, 0 without a prediction; NaN at the end of life itself.
    """
    t, p = _pair(true, predicted)
    alive = t > 0
    error = 100 * (t - p) / np.where(alive, t, 1.0)
    score = np.where(error <= 0, 0.5 ** (-np.minimum(error, 0.0) / 5), 0.5 ** (np.maximum(error, 0.0) / 20))
    return np.where(alive, np.where(np.isfinite(p), score, 0.0), np.nan)


def phm2012_score(true: ArrayLike, predicted: ArrayLike) -> float:
    """Mean of `phm2012_accuracy`; the challenge took one prediction of each of eleven bearings (winner: about 0.31)."""
    each = phm2012_accuracy(true, predicted)
    kept = np.isfinite(each)
    return float(each[kept].mean()) if kept.any() else float("nan")


def coverage(true: ArrayLike, low: ArrayLike, high: ArrayLike) -> Coverage:
    """Share of rows with an interval whose interval holds the truth.

    Parameters
    ----------
    true, low, high : array_like [rows]
        NaN where no interval was given; high may be inf.

    Returns
    -------
    Coverage
        share (NaN without rows), mean width in the unit of remaining life, rows.
    """
    t, lo = _pair(true, low)
    _, hi = _pair(true, high)
    given = ~np.isnan(lo) & ~np.isnan(hi)
    if not given.any():
        return Coverage(float("nan"), float("nan"), 0)
    t, lo, hi = t[given], lo[given], hi[given]
    return Coverage(float(np.mean((lo <= t) & (t <= hi))), float(np.mean(hi - lo)), int(given.sum()))


def _pair(true: ArrayLike, predicted: ArrayLike) -> tuple[Array, Array]:
    """Both as arrays of one length, the truth finite and not negative."""
    t, p = np.atleast_1d(np.asarray(true, float)), np.atleast_1d(np.asarray(predicted, float))
    if t.ndim != 1 or t.shape != p.shape:
        raise TwingapError(f"{t.shape} true and {p.shape} predicted lives, one of each per row expected", where="rows")
    if not np.isfinite(t).all() or (t < 0).any():
        raise TwingapError("a true remaining life is negative or not finite", where="rows")
    return t, p


def _positive(value: float, name: str) -> None:
    if not value > 0:
        raise TwingapError(f"{name} = {value!r}, a number above 0 expected", where="metrics")
