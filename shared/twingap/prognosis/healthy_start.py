"""Test of whether the first rows of a run, which are the reference of its amplitudes, were healthy.

normalised amplitude of the healthy rows --Kendall--> `rises`: they grow already
amplitude from the first row to the alarm --growth from the first row, or after the healthy ones--> `shown_healthy`

A damaged run of constant amplitude cannot be distinguished from a healthy one by its amplitudes.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.speed_influence import SAME_SPEED

Array = NDArray[np.float64]

_EVIDENCE: Final = 6.0
"""Twice the difference in log likelihood by which growth after the healthy rows must explain amplitude better than
growth from the first row. Larger accepts fewer starts as healthy; with 6, 3 % of healthy simulated starts are not
accepted."""
_ROWS_A_SPEED: Final = 4
"""Median number of rows in a speed class; more make classes wider."""
_ONSETS: Final = 25
"""Number of possible onsets after the healthy rows that are tried."""
_OUTLIER: Final = 3.0
"""Standard deviations to which deviations of rows before the anomaly are clipped."""


def rises(normalised: Array) -> int | None:
    """Number of first rows to use as reference instead, if amplitude rises within the healthy rows; else None.

    Parameters
    ----------
    normalised : Array [healthy rows]
        Amplitude relative to its healthy value at the same speed.
    """
    from scipy.stats import kendalltau, theilslopes

    x = np.log(normalised)
    found = kendalltau(np.arange(x.size), x)
    if not (found.pvalue < 1e-4 and found.statistic > 0):
        return None
    rise = float(theilslopes(x).slope) * x.size
    return max(x.size // 6, 4) if rise > 0.2 else None


def shown_healthy(
    log_amplitude: Array, speed_rpm: Array, healthy: int, onset: int, *, scatter: float, memory: float
) -> bool:
    """Whether growth after the healthy rows explains amplitude clearly better than growth from the first row.

    Both models are linear in log amplitude from their onset on, with a separate level for every speed: where speed
    varies, the healthy amplitude of a speed is estimated from few rows and includes their growth.

    Parameters
    ----------
    log_amplitude : Array [rows]
        Log amplitude relative to the healthy one at the same speed, from the first row to the row of the alarm.
    speed_rpm : Array [rows]
    healthy, onset : int
        Rows that count as healthy, and rows before the anomaly.
    scatter, memory : float
        Standard deviation of healthy log amplitude, and its correlation from one row to the next.
    """
    n, place = log_amplitude.size, _places(speed_rpm)
    count = np.bincount(place)

    def within(values: Array) -> Array:
        return np.asarray(values - (np.bincount(place, values) / count)[place])

    usual = float(np.median(log_amplitude[:healthy]))
    y = log_amplitude.copy()
    y[:onset] = np.clip(y[:onset], usual - _OUTLIER * scatter, usual + _OUTLIER * scatter)
    y = within(y)
    row = np.arange(n, dtype=float)

    def left(first: float) -> float:
        """Residual sum of squares of growth from this row on."""
        grown = within(np.maximum(row - first, 0.0))
        size = float(grown @ grown)
        slope = max(float(grown @ y) / size, 0.0) if size > 0 else 0.0
        return float(y @ y) - slope * float(grown @ y)

    early = min(left(first) for first in (-n / 2, -n / 4, 0.0, healthy / 4))
    late = min(left(first) for first in np.linspace(healthy, max(onset, healthy), _ONSETS))
    variance = max(min(early, late) / max(n - count.size - 2, 1), 1e-12)
    return (early - late) / variance * (1 - memory) / (1 + memory) > _EVIDENCE


def _places(speed_rpm: Array) -> NDArray[np.int64]:
    """Index of the speed class of each row [rows]; classes are as narrow as leaves enough rows in most of them."""
    for width in (SAME_SPEED, 0.06, 0.12, 0.25, 0.5, 1.0):
        classes = np.round(np.log(speed_rpm / speed_rpm[0]) / width)
        _, place, count = np.unique(classes, return_inverse=True, return_counts=True)
        if np.median(count) >= _ROWS_A_SPEED:
            return np.asarray(place.ravel(), np.int64)
    return np.zeros(speed_rpm.size, np.int64)
