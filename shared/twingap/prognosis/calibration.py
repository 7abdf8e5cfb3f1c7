"""Calibration of 90 % intervals of remaining life, by quantile regression on simulated runs.

simulated runs --OnlineLife--> posterior, true life --quantile regression--> TABLE --> corrected median and interval

Growth laws alone err in ways that simulated runs show: soon after the onset rates are estimated from a few rows, lives
many times longer than what has passed of them are rare, laws change. Quantiles of the true life are linear in terms of
the posterior (Koenker and Bassett 1978, DOI 10.2307/1913643), so that estimates do not jump from row to row.
`interval_study` makes and checks the table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.calibration_table import TABLE

Array = NDArray[np.float64]

TERMS: Final = 13
_NARROWEST: Final = 0.05


@dataclass(frozen=True)
class Posterior:
    """Remaining revolutions by the growth laws, before calibration.

    Parameters
    ----------
    low, middle, high : float
        5 %, 50 % and 95 %.
    per_row : float
        Revolutions from row to row.
    rows : int
        Since the onset.
    progress : float
        Present log amplitude over that at the end of life.
    since_onset : float
        Revolutions.
    """

    low: float
    middle: float
    high: float
    per_row: float
    rows: int
    progress: float
    since_onset: float

    def relative(self, revolutions: float) -> float:
        """Logarithm of a life over that since the onset; half a row more, so that the end itself has a place."""
        return float(np.log((revolutions + self.per_row / 2) / (self.since_onset + self.per_row / 2)))

    def absolute(self, relative: float) -> float:
        """The life of which `relative` is so much, not negative."""
        whole = (self.since_onset + self.per_row / 2) * float(np.exp(relative))
        return max(whole - self.per_row / 2, 0.0)

    @property
    def terms(self) -> Array:
        """What the regression is linear in [TERMS]; held within what simulated runs reach."""
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
        The shipped one when absent.

    Returns
    -------
    tuple of float
        None negative, in increasing order.
    """
    found = np.sort(np.asarray(TABLE if table is None else table) @ posterior.terms)
    low, middle, high = (posterior.absolute(float(v)) for v in np.clip(found, -12.0, 12.0))
    return low, middle, high
