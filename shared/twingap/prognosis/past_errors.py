"""Errors of past intervals of remaining life on runs that have ended, and the widening of future intervals.

a run's estimates, its end --errors--> error over half width [rows];  those of several runs --widening--> a factor
a factor --widened--> the next run's intervals

Intervals are calibrated on simulated runs; real ones may grow by other laws. Runs that have ended show by how much, as
in conformal prediction (Lei et al. 2018, DOI 10.1080/01621459.2017.1307116), but with whole runs for exchangeable
units: rows of one run err together. Without further assumptions the next of n runs has weight 1 / (n + 1), at an
infinite error: no finite interval is sure to hold 90 % before n = 9. With fewer, that weight is given to the
errors of calibrated intervals, as on simulated runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

Array = NDArray[np.float64]
Interval = tuple[float, float, float]

ROWS: Final = 64
"""Most rows of a run that are used: evenly spaced. More follow a run more closely and cost time."""
_LEVEL: Final = 0.9
_BOUNDS: Final = (0.5, 5.0)
"""Least and greatest widening: few runs are no evidence for more."""
_CALIBRATED: Final = np.asarray(ndtri(0.5 + 0.5 * (np.arange(ROWS) + 0.5) / ROWS) / ndtri(0.5 + _LEVEL / 2))
"""Errors of calibrated intervals: half-normal in logarithms."""


@dataclass(frozen=True, eq=False)
class PastIntervals:
    """Intervals of remaining life by growth alone, after the alarm of a run that has ended.

    Parameters
    ----------
    growth : Array [rows, 3]
        5 %, 50 % and 95 % of remaining revolutions.
    lived, since_onset, left : Array [rows]
        Revolutions since the first row, since the onset of the anomaly, and to the end.
    per_row : float
        Revolutions from row to row.
    """

    growth: Array
    lived: Array
    since_onset: Array
    left: Array
    per_row: float

    def thinned(self) -> PastIntervals:
        """Of evenly spaced rows with an estimate, at most `ROWS`."""
        rows = spaced(np.isfinite(self.growth[:, 1]) & np.isfinite(self.left))
        return PastIntervals(self.growth[rows], self.lived[rows], self.since_onset[rows], self.left[rows], self.per_row)

    def errors(self, intervals: Array | None = None) -> Array:
        """`errors` of these intervals [rows, 3], or of growth alone."""
        low, middle, high = (self.growth if intervals is None else intervals).T
        return errors(middle, low, high, self.left, self.per_row / 2)

    def log_error(self, intervals: Array) -> float:
        """Mean absolute error of the logarithm of these medians [rows, 3], half a row added."""
        unit = self.per_row / 2
        return float(np.mean(np.abs(np.log((intervals[:, 1] + unit) / (self.left + unit)))))


def spaced(usable: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Evenly spaced ones of the rows that are usable [rows], at most `ROWS`."""
    rows = np.flatnonzero(usable)
    return rows[np.unique(np.linspace(0, rows.size - 1, ROWS).round().astype(int))] if rows.size else rows


def errors(predicted: Array, low: Array, high: Array, true: Array, unit: float) -> Array:
    """Errors in logarithms over the half width of the interval on their side; at most 1 inside it.

    Parameters
    ----------
    predicted, low, high : Array [rows]
        Median and interval of what remains.
    true : Array [rows]
        What remained.
    unit : float
        Added to all of them before their logarithm: half of what passes from row to row.

    Returns
    -------
    Array [at most `ROWS`]
        Of evenly spaced rows, infinite where an interval without width misses.
    """
    chosen = spaced(np.isfinite(predicted) & np.isfinite(true))
    below, middle, above, end = (np.log(np.maximum(v[chosen], 0.0) + unit) for v in (low, predicted, high, true))
    error = end - middle
    width = np.where(error > 0, above - middle, middle - below)
    return np.asarray(np.where(error == 0, 0.0, np.abs(error) / np.maximum(width, 1e-300)))


def widening(runs: Sequence[Sequence[float] | Array]) -> float:
    """The factor by which intervals of runs that ended should have been wider in logarithms.

    Parameters
    ----------
    runs : sequence of sequence of float
        Each run's `errors`; each weighs the same, and as much as all simulated runs do. Empty ones are left out.

    Returns
    -------
    float
        0.5 to 5; 1 without any run.
    """
    given = [np.asarray(own, float) for own in runs if len(own)]
    if not given:
        return 1.0
    given.append(_CALIBRATED)
    size = np.concatenate(given)
    weight = np.concatenate([np.full(own.size, 1 / own.size / len(given)) for own in given])
    order = np.argsort(size, kind="stable")
    place = int(np.searchsorted(np.cumsum(weight[order]), _LEVEL))
    return float(np.clip(size[order][min(place, size.size - 1)], *_BOUNDS))


def widened(interval: Interval, factor: float, unit: float) -> Interval:
    """An interval (low, median, high) whose ends lie `factor` times as far from its median in logarithms."""
    low, middle, high = (np.log(v + unit) for v in interval)
    return (
        max(float(np.exp(middle - factor * (middle - low))) - unit, 0.0),
        interval[1],
        max(float(np.exp(middle + factor * (high - middle))) - unit, interval[1]),
    )
