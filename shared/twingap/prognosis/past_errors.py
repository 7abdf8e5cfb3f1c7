"""Errors of past intervals of remaining life on runs that have ended, and the widening of future intervals.

estimates and end of a run --errors--> error over half width [rows];  errors of several runs --widening--> factor
factor --Prior--> intervals of the next run

Intervals are calibrated on simulated runs, but real runs may follow other growth laws. As in conformal prediction (Lei
et al. 2018, DOI 10.1080/01621459.2017.1307116), the errors on runs that have ended give a correction. The exchangeable
units are runs, since errors within a run are correlated. Without further assumptions, one more run with an infinite
error has to be added with weight 1 / (n + 1), so that no finite interval covers 90 % for n < 9. Instead, this weight is
given to the errors of calibrated intervals on simulated runs.
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
"""Most rows of a run that are used, evenly spaced; more follow the run more closely and are slower."""
_LEVEL: Final = 0.9
_BOUNDS: Final = (0.5, 5.0)
"""Bounds of the factor, since few runs are no evidence for extreme values; wider bounds follow the runs more freely."""
_NARROWING: Final = 0.5
"""Exponent of the least factor that every ended run allows: 0 never narrows, 1 trusts these few runs entirely."""
_CALIBRATED: Final = np.asarray(ndtri(0.5 + 0.5 * (np.arange(ROWS) + 0.5) / ROWS) / ndtri(0.5 + _LEVEL / 2))
"""Errors of calibrated intervals over their half width: half-normal in logarithms [ROWS]."""


@dataclass(frozen=True, eq=False)
class PastIntervals:
    """Intervals of remaining life by growth alone, after the alarm of an ended run.

    Parameters
    ----------
    growth : Array [rows, 3]
        Quantiles of 5 %, 50 % and 95 % of remaining revolutions.
    lived, since_onset, left : Array [rows]
        Revolutions since the first row, since the onset of the anomaly, and to the end.
    per_row : float
        Mean revolutions between rows.
    """

    growth: Array
    lived: Array
    since_onset: Array
    left: Array
    per_row: float

    def thinned(self) -> PastIntervals:
        """The intervals at evenly spaced rows that have an estimate, at most `ROWS`."""
        rows = spaced(np.isfinite(self.growth[:, 1]) & np.isfinite(self.left))
        return PastIntervals(self.growth[rows], self.lived[rows], self.since_onset[rows], self.left[rows], self.per_row)

    def scaled(self, factor: float) -> PastIntervals:
        """The same with all revolutions multiplied."""
        growth, lived, since, left = (factor * v for v in (self.growth, self.lived, self.since_onset, self.left))
        return PastIntervals(growth, lived, since, left, factor * self.per_row)

    def errors(self, intervals: Array | None = None) -> Array:
        """`errors` of these intervals [rows, 3]; of growth alone when absent."""
        low, middle, high = (self.growth if intervals is None else intervals).T
        return errors(middle, low, high, self.left, self.per_row / 2)

    def log_error(self, intervals: Array) -> float:
        """Mean absolute error of the logarithm of the medians of intervals [rows, 3], each plus half a row."""
        unit = self.per_row / 2
        return float(np.mean(np.abs(np.log((intervals[:, 1] + unit) / (self.left + unit)))))


def spaced(usable: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Indices of evenly spaced usable rows, at most `ROWS`."""
    rows = np.flatnonzero(usable)
    return rows[np.unique(np.linspace(0, rows.size - 1, ROWS).round().astype(int))] if rows.size else rows


def errors(predicted: Array, low: Array, high: Array, true: Array, unit: float) -> Array:
    """Errors of the logarithm relative to the half width of the interval on the same side; at most 1 inside it.

    Parameters
    ----------
    predicted, low, high : Array [rows]
        Median and interval of the remaining life.
    true : Array [rows]
        True remaining life.
    unit : float
        Added before taking logarithms: half of the mean distance of rows.

    Returns
    -------
    Array [at most `ROWS`]
        At evenly spaced rows; very large where an interval without width misses.
    """
    chosen = spaced(np.isfinite(predicted) & np.isfinite(true))
    below, middle, above, end = (np.log(np.maximum(v[chosen], 0.0) + unit) for v in (low, predicted, high, true))
    error = end - middle
    width = np.where(error > 0, above - middle, middle - below)
    return np.asarray(np.where(error == 0, 0.0, np.abs(error) / np.maximum(width, 1e-300)))


def widening(runs: Sequence[Sequence[float] | Array]) -> float:
    """Factor by which intervals of ended runs should have been wider in logarithms.

    Parameters
    ----------
    runs : sequence of sequence of float
        `errors` of each run. Each run has the same weight, equal to that of all simulated runs. Empty ones are ignored.

    Returns
    -------
    float
        0.5 to 5; 1 without runs.
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


def pooled_widening(runs: Sequence[Sequence[float] | Array]) -> float:
    """Factor on the width of pooled intervals: `widening`, or where that is below 1, a part of what every run allows.

    The law of few lives is wide, so that intervals may be too wide even for the run that needed most of them. With the
    factor that would still have covered 90 % of the rows of each ended run, the next of n + 1 exchangeable runs has
    this coverage with probability n / (n + 1); half the way to it, in logarithms, is taken.

    Parameters
    ----------
    runs : sequence of sequence of float
        `errors` of each run; at least one is not empty.

    Returns
    -------
    float
        0.5 ** 0.5 to 5.
    """
    wider = widening(runs)
    if wider >= 1:
        return wider
    least = max(float(np.quantile(np.asarray(own, float), _LEVEL)) for own in runs if len(own))
    return float(np.clip(least, _BOUNDS[0], 1.0) ** _NARROWING)
