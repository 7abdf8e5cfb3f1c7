"""Estimate of remaining life at one row, and options of the estimation."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from twingap.errors import TwingapError
from twingap.prognosis.anomaly import AnomalyRule
from twingap.prognosis.revolutions import Gaps

_HIGHEST_RATIO: Final = 1e6
"""Largest ratio accepted; no accelerometer has a wider range between noise and full scale."""


@dataclass(frozen=True)
class LifeOptions:
    """Options of the estimation of remaining life.

    Parameters
    ----------
    limit : float or None
        Peak to peak at which life ends, in the unit of the records, at any speed (15 g in paper 1). None: the end is
        given by `limit_ratio`.
    limit_ratio : float
        Amplitude at the end of life relative to the healthy one at the same speed.
    healthy_rows : int
        First rows of the run, assumed healthy.
    rule : AnomalyRule
        Rule of the alarm.
    gaps : {"running", "stopped"}
        Whether the machine ran or stood still during gaps in the rows.
    """

    limit: float | None = None
    limit_ratio: float = 10.0
    healthy_rows: int = 60
    rule: AnomalyRule = field(default_factory=AnomalyRule)
    gaps: Gaps = "running"

    def __post_init__(self) -> None:
        if self.limit is not None and not (np.isfinite(self.limit) and self.limit > 0):
            raise TwingapError(f"limit = {self.limit!r}, a positive amplitude expected", where="end of life")
        if not 1 < self.limit_ratio <= _HIGHEST_RATIO:
            wanted = f"more than 1 and at most {_HIGHEST_RATIO:g} expected"
            raise TwingapError(f"limit ratio = {self.limit_ratio!r}, {wanted}", where="end of life")
        if self.healthy_rows < 8:
            raise TwingapError(f"{self.healthy_rows} healthy rows, at least 8 expected", where="healthy rows")


@dataclass(frozen=True)
class Estimate:
    """Remaining life at a row; NaN where it is unknown.

    Parameters
    ----------
    anomaly : bool
        Whether the alarm has been given.
    revolutions, revolutions_lo, revolutions_hi : float
        Median and 90 % interval of remaining revolutions.
    speed_rpm : float
        Speed at the row, rpm; 0 while the machine stands still.
    closed_lo : float or None
        Where the lower end is set to 0 (see `OnlineLife.open_below`): lower end that growth alone would give.
    """

    anomaly: bool
    revolutions: float = float("nan")
    revolutions_lo: float = float("nan")
    revolutions_hi: float = float("nan")
    speed_rpm: float = 0.0
    closed_lo: float | None = None

    def at_most(self) -> Estimate:
        """The upper end alone, where amplitude is known to be larger than recorded."""
        return replace(self, revolutions=float("nan"), revolutions_lo=0.0 * self.revolutions_hi, closed_lo=None)

    def closed(self) -> Estimate:
        """The same estimate with the lower end by growth alone, as past intervals use it."""
        if self.closed_lo is None:
            return self
        return replace(self, revolutions_lo=self.closed_lo, closed_lo=None)

    def time_s(self) -> tuple[float, float, float]:
        """Median, lower and upper remaining time at the speed of the row (eq. 14), s; NaN at standstill."""
        if not self.speed_rpm > 0:
            return (float("nan"),) * 3
        a, b, c = (60 * v / self.speed_rpm for v in (self.revolutions, self.revolutions_lo, self.revolutions_hi))
        return a, b, c
