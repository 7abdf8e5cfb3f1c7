"""Count of revolutions from the times and speeds of rows, with rules for gaps.

time, speed --> spacing from the row before --longer than usual--> gap: counted or not, with a note
                                            --otherwise---------> turns = mean speed x time
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np

GAP: Final = 3.0
"""Ratio of a spacing to the usual one above which it is a gap; larger accepts more irregular sampling."""
_IRREGULAR: Final = 10.0
"""Largest value to which irregular sampling raises that ratio."""
_SPACINGS: Final = 20
"""Number of last spacings whose median is the usual one; more adapt more slowly."""
_FIRST_ROWS: Final = 8
"""First rows, whose spacings are evaluated again while the usual one is still being estimated."""

Gaps = Literal["running", "stopped"]
"""Whether the machine ran or stood still during gaps in the rows."""


class _Spacing(NamedTuple):
    """Spacing between two rows, the second at `time_s`: duration, turns and mean speed."""

    time_s: float
    dt_s: float
    turns: float
    speed_rpm: float


class RevolutionCount:
    """Counter of the revolutions of a run from the times and speeds of its rows.

    Parameters
    ----------
    gaps : {"running", "stopped"}
        Whether the machine ran or stood still during gaps.

    Attributes
    ----------
    revolutions : float
        Revolutions since the first row.
    time_s : float or None
        Time of the last row, s.
    speed_rpm : float
        Speed at the last row, rpm; 0 while the machine stands still.
    rows : int
        Number of rows so far.
    """

    def __init__(self, gaps: Gaps = "running") -> None:
        self._gaps = gaps
        self.revolutions = 0.0
        self.time_s: float | None = None
        self.speed_rpm = 0.0
        self.rows = 0
        self._spacings: list[_Spacing] = []
        self._first_spacings: list[_Spacing] = []

    def take(self, time_s: float, speed_rpm: float) -> list[str]:
        """Process the next row.

        Parameters
        ----------
        time_s : float
            Time, s, finite and not before the last row's.
        speed_rpm : float
            Speed, rpm; where it is not finite, that of the row before is used.

        Returns
        -------
        list of str
            A note for each gap that is detected with this row.
        """
        self.rows += 1
        notes: list[str] = []
        speed = max(speed_rpm, 0.0) if np.isfinite(speed_rpm) else self.speed_rpm
        if self.time_s is not None:
            dt_s, mean = time_s - self.time_s, (speed + self.speed_rpm) / 2
            turns = mean * dt_s / 60 if min(speed, self.speed_rpm) > 0 else 0.0
            spacing = _Spacing(time_s, dt_s, turns, mean)
            self._spacings = [*self._spacings[1 - _SPACINGS :], spacing]
            longest = self._longest_spacing()
            # A gap among the first rows is detected once enough spacings are known.
            for earlier in (s for s in self._first_spacings if s.dt_s > longest):
                self.revolutions -= self._not_counted(earlier, notes)
            self.revolutions += turns - (self._not_counted(spacing, notes) if dt_s > longest else 0.0)
            kept = [s for s in (*self._first_spacings, spacing) if s.dt_s <= longest]
            self._first_spacings = kept if self.rows < _FIRST_ROWS else []
        self.time_s, self.speed_rpm = time_s, speed
        return notes

    def _longest_spacing(self) -> float:
        """Longest spacing that is no gap, s; infinite while fewer than three spacings are known.

        Since gaps only lengthen spacings, their irregularity is the ratio of the median to the shortest tenth.
        """
        lengths = sorted(s.dt_s for s in self._spacings if s.dt_s > 0)
        if len(lengths) < 3:
            return float("inf")
        usual, short = lengths[len(lengths) // 2], lengths[(len(lengths) - 1) // 10]
        return usual * min(max(GAP, usual / short), _IRREGULAR)

    def _not_counted(self, gap: _Spacing, notes: list[str]) -> float:
        """Revolutions of a gap that are not counted; appends a note."""
        counted = self._gaps == "running" and gap.turns > 0
        how = f"counted at {gap.speed_rpm:.0f} rpm" if counted else "not counted"
        notes.append(f"gap of {gap.dt_s:.6g} s before time_s = {gap.time_s:.6g}: its revolutions are {how}")
        return 0.0 if counted else gap.turns
