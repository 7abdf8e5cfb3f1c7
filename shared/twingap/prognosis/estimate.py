"""An estimate of remaining life at one row, and the options of estimation."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from twingap.errors import TwingapError
from twingap.prognosis.anomaly import AnomalyRule
from twingap.prognosis.revolutions import Gaps

_HIGHEST_RATIO: Final = 1e6
"""No accelerometer has a wider range between its noise and full scale."""


@dataclass(frozen=True)
class LifeOptions:
    """How remaining life is estimated.

    Parameters
    ----------
    limit : float or None
        Peak to peak at which a life ends, unit of the records, at whatever speed (15 g in paper 1). None: by
        `limit_ratio`.
    limit_ratio : float
        Amplitude at the end over the healthy one at the same speed.
    healthy_rows : int
        Rows at the beginning of the run that are taken to be healthy.
    rule : AnomalyRule
        States the rate of false alarms.
    gaps : {"running", "stopped"}
        Whether the machine ran while rows are missing.
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
    """Remaining life as known at a row; NaN where it is not known.

    Parameters
    ----------
    anomaly : bool
    revolutions, revolutions_lo, revolutions_hi : float
        Median and 90 % interval.
    speed_rpm : float
        Of the row.
    closed_lo : float or None
        Where the lower end is left open, at 0: what it would be after a healthy start. See `OnlineLife.open_below`.
    """

    anomaly: bool
    revolutions: float = float("nan")
    revolutions_lo: float = float("nan")
    revolutions_hi: float = float("nan")
    speed_rpm: float = 0.0
    closed_lo: float | None = None

    def closed(self) -> Estimate:
        """The same with the lower end by growth, as past intervals use it."""
        if self.closed_lo is None:
            return self
        return replace(self, revolutions_lo=self.closed_lo, closed_lo=None)

    def time_s(self) -> tuple[float, float, float]:
        """Median, lower and upper remaining time at the row's own speed (eq. 14), s; NaN while it stands still."""
        if not self.speed_rpm > 0:
            return (float("nan"),) * 3
        a, b, c = (60 * v / self.speed_rpm for v in (self.revolutions, self.revolutions_lo, self.revolutions_hi))
        return a, b, c
