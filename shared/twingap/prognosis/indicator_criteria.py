"""Criteria of a health indicator: monotonicity, correlation with time, robustness and sensitivity.

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
    """Criteria of an indicator: larger is better; all are between 0 and 1 except sensitivity, which is unbounded.

    Parameters
    ----------
    monotonicity : float
        |number of rising - falling steps| of the trend over the number of steps.
    trendability : float
        |Pearson correlation| of the trend with time.
    robustness : float
        Mean of exp(-|indicator - trend| / range of the trend). The published form divides by the indicator, so that it
        depends on the position of zero, which normalised indicators have at the healthy level.
    sensitivity : float
        Largest distance of the trend from the healthy mean in the last tenth of the rows, in healthy standard
        deviations of single rows.
    """

    monotonicity: float
    trendability: float
    robustness: float
    sensitivity: float

    @property
    def suitability(self) -> float:
        """Mean of the first three criteria, by which indicators are selected; no weights are published."""
        return (self.monotonicity + self.trendability + self.robustness) / 3


def causal_trend(values: ArrayLike, window: int) -> Array:
    """Moving average over each row and those before it.

    Parameters
    ----------
    values : array_like [rows, ...]
    window : int
        Rows averaged; fewer at the beginning. 1 returns the values.

    Returns
    -------
    Array [rows, ...]
        Row k does not depend on later rows.

    Raises
    ------
    TwingapError
        For a window below 1.
    """
    x = np.asarray(values, float)
    if window < 1:
        raise TwingapError(f"window = {window}, 1 or more expected", where="trend")
    # Separate means per row: rounding of a running sum would give steps where values are constant.
    padded = np.concatenate([np.full((window - 1, *x.shape[1:]), np.nan), x])
    rows = np.lib.stride_tricks.sliding_window_view(padded, window, axis=0)
    return np.asarray(np.nanmean(rows, axis=-1), float)


def evaluate_indicator(
    values: ArrayLike, time_s: ArrayLike, *, healthy_rows: int, window: int = 1
) -> IndicatorCriteria:
    """Criteria of an indicator over a run.

    Parameters
    ----------
    values : array_like [rows]
    time_s : array_like [rows]
        Increasing.
    healthy_rows : int
        Number of first rows, assumed healthy, at least 2.
    window : int
        Rows of the moving average.

    Returns
    -------
    IndicatorCriteria
        All 0 for a constant indicator.

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
    """Pearson's correlation, between -1 and 1; 0 where one of the series is constant."""
    x, y = x - x.mean(), y - y.mean()
    size = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    return float(np.clip(np.sum(x * y) / size, -1, 1)) if size > 0 else 0.0
