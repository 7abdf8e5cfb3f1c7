"""Calibration of 90 % intervals of remaining life, by quantile regression on simulated runs.

simulated runs --OnlineLife--> posterior, true life --quantile regression--> TABLE --> corrected median and interval

Intervals by growth laws alone have systematic errors: soon after the onset rates are estimated from few rows, very long
lives are rare, and laws change. Quantiles of the true life are therefore regressed on terms of the posterior (Koenker
and Bassett 1978, DOI 10.2307/1913643); they are linear in these, so that estimates do not jump from row to row.
`interval_study` computes and evaluates the table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.calibration_table import TABLE

Array = NDArray[np.float64]

TERMS: Final = 13
"""Number of terms of the regression."""
_NARROWEST: Final = 0.05
"""Smallest half width of an interval in logarithms that enters the regression; it limits extrapolation."""


@dataclass(frozen=True)
class Posterior:
    """Remaining revolutions by growth laws, before calibration.

    Parameters
    ----------
    low, middle, high : float
        Quantiles of 5 %, 50 % and 95 %.
    per_row : float
        Mean revolutions between rows.
    rows : int
        Rows since the onset.
    progress : float
        Present log amplitude relative to that at the end of life.
    since_onset : float
        Revolutions since the onset.
    """

    low: float
    middle: float
    high: float
    per_row: float
    rows: int
    progress: float
    since_onset: float

    def relative(self, revolutions: float) -> float:
        """Logarithm of a remaining life relative to that since the onset, each plus half a row to be finite at 0."""
        return float(np.log((revolutions + self.per_row / 2) / (self.since_onset + self.per_row / 2)))

    def absolute(self, relative: float) -> float:
        """Inverse of `relative`, not negative."""
        life = (self.since_onset + self.per_row / 2) * float(np.exp(relative))
        return max(life - self.per_row / 2, 0.0)

    @property
    def terms(self) -> Array:
        """Terms of the regression [TERMS], clipped to the range of the simulated runs."""
        low, middle, high = (self.relative(v) for v in (self.low, self.middle, self.high))
        a = float(np.clip(middle, -4.0, 4.0))
        p = float(np.clip(self.progress, 0.0, 1.1))
        n = float(np.clip(np.log(max(self.rows, 1)), 1.0, 6.5))
        down, up = (float(np.clip(v, _NARROWEST, 4.0)) for v in (middle - low, high - middle))
        return np.array([1.0, a, a * abs(a), max(a - 1, 0.0), p, p * p, a * p, n, n * n, n * a, n * p, down, up])


def calibrated(posterior: Posterior, table: Array | None = None) -> tuple[float, float, float]:
    """Lower end, median and upper end of remaining revolutions.

    Parameters
    ----------
    posterior : Posterior
    table : Array [3, TERMS], optional
        Coefficients; `TABLE` when absent.

    Returns
    -------
    tuple of float
        Not negative, in increasing order.
    """
    found = np.sort(np.asarray(TABLE if table is None else table) @ posterior.terms)
    low, middle, high = (posterior.absolute(float(v)) for v in np.clip(found, -12.0, 12.0))
    return low, middle, high
