"""Criteria of a health indicator: monotonicity, correlation with time, robustness, and range.

indicator --causal moving average--> trend --> monotonicity, trendability
indicator less trend ------------------------> robustness;   trend, healthy rows --> sensitivity

Sources: monotonicity, Coble and Hines 2009, Identifying optimal prognostic parameters from data, Annual Conference of
the PHM Society; correlation with time as trendability, and robustness, Zhang, Zhang and Xu 2016, DOI 10.1002/qre.1771,
all three reviewed by Lei et al. 2018, DOI 10.1016/j.ymssp.2017.11.016.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class IndicatorCriteria:
    """Each between 0 and 1, and more is better, but for sensitivity, which has no upper end.

    Parameters
    ----------
    monotonicity : float
        |rising steps - falling steps| of the trend over all its steps.
    trendability : float
        |Pearson correlation| of the trend with time.
    robustness : float
        Mean of exp(-|indicator - trend| / range of the trend). The published form divides by the indicator itself,
        which makes it depend on where zero lies; normalised indicators have it at the healthy level.
    sensitivity : float
        Greatest distance of the trend from the healthy mean, in the last tenth of the rows, in healthy standard
        deviations of single rows.
    """

    monotonicity: float
    trendability: float
    robustness: float
    sensitivity: float

    @property
    def suitability(self) -> float:
        """Mean of the first three, by which indicators are chosen. Equal weights are a choice: none is published."""
        return (self.monotonicity + self.trendability + self.robustness) / 3


def causal_trend(values: ArrayLike, window: int) -> Array:
    """Mean of each row and those before it.

    Parameters
    ----------
    values : array_like [rows, ...]
    window : int
        Rows averaged; fewer at the beginning. 1 leaves values as they are.

    Returns
    -------
    Array [rows, ...]
        Row k depends on no later row.

    Raises
    ------
    TwingapError
        For a window below 1.
    """
    x = np.asarray(values, float)
    if window < 1:
        raise TwingapError(f"window = {window}, 1 or more expected", where="trend")
    # A sum per row, not a running one, whose rounding would make steps of a level that is constant.
    padded = np.concatenate([np.full((window - 1, *x.shape[1:]), np.nan), x])
    rows = np.lib.stride_tricks.sliding_window_view(padded, window, axis=0)
    return np.asarray(np.nanmean(rows, axis=-1), float)


def judge(values: ArrayLike, time_s: ArrayLike, *, healthy_rows: int, window: int = 1) -> IndicatorCriteria:
    """Criteria of an indicator over a run.

    Parameters
    ----------
    values : array_like [rows]
    time_s : array_like [rows]
        Increasing.
    healthy_rows : int
        At the beginning, at least 2.
    window : int
        Of the trend, rows.

    Returns
    -------
    IndicatorCriteria
        All 0 for an indicator that is constant.

    Raises
    ------
    TwingapError
        For fewer than 3 rows.
    """
    x, t = np.asarray(values, float), np.asarray(time_s, float)
    if x.ndim != 1 or x.shape != t.shape or x.size < 3:
        raise TwingapError(f"shapes {x.shape} and {t.shape}, three rows or more of each expected", where="criteria")
    if not 2 <= healthy_rows <= x.size:
        raise TwingapError(f"healthy_rows = {healthy_rows} of {x.size}, at least 2 expected", where="criteria")
    trend = causal_trend(x, window)
    steps = np.sign(np.diff(trend))
    reach = float(np.ptp(trend))
    if reach == 0:
        return IndicatorCriteria(0.0, 0.0, 0.0, 0.0)
    healthy = x[:healthy_rows]
    spread = float(healthy.std(ddof=1))
    far = float(np.abs(trend[-max(x.size // 10, 1) :] - healthy.mean()).max())
    return IndicatorCriteria(
        monotonicity=abs(float(steps.sum())) / steps.size,
        trendability=abs(correlation(trend, t)),
        robustness=float(np.mean(np.exp(-np.abs(x - trend) / reach))),
        sensitivity=far / spread if spread > 0 else np.inf,
    )


def correlation(x: Array, y: Array) -> float:
    """Pearson's, between -1 and 1; 0 where one of them does not vary."""
    x, y = x - x.mean(), y - y.mean()
    size = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    return float(np.clip(np.sum(x * y) / size, -1, 1)) if size > 0 else 0.0
