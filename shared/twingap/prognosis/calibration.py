"""Intervals that cover what they state: the posterior's, corrected by what simulated runs showed.

simulated runs --OnlineLife--> posterior, true life --> errors in half widths, by stage --> TABLE --> corrected interval

A stage is how many rows there are since the onset, and how much of the way to the end level amplitude has gone. The
correction is split-conformal (Lei et al. 2018, DOI 10.1080/01621459.2017.1307116) within each stage, over runs instead
of rows: rows of one run err together, so every run counts the same whatever its length. `interval_study` makes and
checks the table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.calibration_table import TABLE

Array = NDArray[np.float64]

ROWS: Final = (15, 40, 120, 400)
"""Borders of the stages, rows since the onset."""
PROGRESS: Final = (0.3, 0.5, 0.75)
"""Borders of the stages, share of the end level's logarithm."""
_ROW_CENTRES: Final = np.log([8.0, 25.0, 70.0, 220.0, 800.0])
_PROGRESS_CENTRES: Final = np.array([0.2, 0.4, 0.62, 0.88])
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
    """

    low: float
    middle: float
    high: float
    per_row: float
    rows: int
    progress: float

    @property
    def stage(self) -> tuple[int, int]:
        """Place in the table."""
        row = int(np.searchsorted(ROWS, self.rows, side="right"))
        return row, int(np.searchsorted(PROGRESS, self.progress, side="right"))

    def in_log(self, revolutions: float) -> float:
        """Natural logarithm of a life and half a row, so that the end itself has a place."""
        return float(np.log(revolutions + self.per_row / 2))

    @property
    def half_widths(self) -> tuple[float, float]:
        """Lower and upper, in log life."""
        low, middle, high = (self.in_log(v) for v in (self.low, self.middle, self.high))
        return max(middle - low, _NARROWEST), max(high - middle, _NARROWEST)


def calibrated(posterior: Posterior) -> tuple[float, float, float]:
    """Lower end, median and upper end of remaining revolutions.

    Parameters
    ----------
    posterior : Posterior

    Returns
    -------
    tuple of float
        None negative, in increasing order.
    """
    below, shift, above = _between(posterior)
    down, up = posterior.half_widths
    centre = posterior.in_log(posterior.middle)
    unit = posterior.per_row / 2
    low, middle, high = (
        max(float(np.exp(centre + v)) - unit, 0.0) for v in (-below * down, shift, above * up)
    )  # fmt: skip
    return min(low, middle), middle, max(high, middle)


def _between(posterior: Posterior) -> Array:
    """Correction [3], interpolated between the middles of stages: a life must not jump where a stage ends."""
    table = np.asarray(TABLE)
    i, a = _place(_ROW_CENTRES, float(np.log(max(posterior.rows, 1))))
    j, b = _place(_PROGRESS_CENTRES, posterior.progress)
    low = (1 - b) * table[i, j] + b * table[i, j + 1]
    return np.asarray((1 - a) * low + a * ((1 - b) * table[i + 1, j] + b * table[i + 1, j + 1]))


def _place(centres: Array, value: float) -> tuple[int, float]:
    """Interval of a grid that holds a value, and how far within; the ends beyond them."""
    i = int(np.clip(np.searchsorted(centres, value) - 1, 0, centres.size - 2))
    return i, float(np.clip((value - centres[i]) / (centres[i + 1] - centres[i]), 0.0, 1.0))
