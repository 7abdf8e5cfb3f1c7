"""Count of revolutions from the times and speeds of rows, with rules for gaps.

time, speed --> spacing from the row before --longer than usual?--> gap: counted or not, and noted
                                            --otherwise--> turns = mean speed x time
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np

GAP: Final = 3.0
"""A row that comes after more than this many times the usual spacing comes after a gap."""
_IRREGULAR: Final = 10.0
"""The most that irregular sampling makes of it."""
_SPACINGS: Final = 20
"""Last spacings whose median is the usual one."""
_FIRST_ROWS: Final = 8
"""First rows, whose spacings are evaluated again as the usual one is learnt, before any row is judged."""

Gaps = Literal["running", "stopped"]
"""Whether the machine ran while rows are missing."""


class _Spacing(NamedTuple):
    """From a row to the next one, at `time_s`: turns counted, at a mean speed."""

    time_s: float
    dt_s: float
    turns: float
    speed_rpm: float


class RevolutionCount:
    """Counts the revolutions of a run from the times and speeds of its rows.

    Parameters
    ----------
    gaps : {"running", "stopped"}

    Attributes
    ----------
    revolutions : float
        Since the first row.
    time_s : float or None
        Of the last row.
    speed_rpm : float
        There, 0 while the machine stands still.
    rows : int
        Taken so far.
    """

    def __init__(self, gaps: Gaps = "running") -> None:
        self._gaps = gaps
        self.revolutions = 0.0
        self.time_s: float | None = None
        self.speed_rpm = 0.0
        self.rows = 0
        self._spacings: list[_Spacing] = []
        self._unsure: list[_Spacing] = []

    def take(self, time_s: float, speed_rpm: float) -> list[str]:
        """Take the next row.

        Parameters
        ----------
        time_s : float
            Finite, and not before the last row's.
        speed_rpm : float
            That of the row before counts where it is not finite.

        Returns
        -------
        list of str
            A note for each gap that is known by this row.
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
            # What is usual is not known at first: a gap among the first rows shows with the ones that follow.
            for earlier in (s for s in self._unsure if s.dt_s > longest):
                self.revolutions -= self._not_counted(earlier, notes)
            self.revolutions += turns - (self._not_counted(spacing, notes) if dt_s > longest else 0.0)
            unsure = [s for s in (*self._unsure, spacing) if s.dt_s <= longest]
            self._unsure = unsure if self.rows < _FIRST_ROWS else []
        self.time_s, self.speed_rpm = time_s, speed
        return notes

    def _longest_spacing(self) -> float:
        """The longest time between rows that is no gap, s; infinite as long as nothing is usual.

        Gaps only lengthen spacings: how irregular these are is read off the shorter half, by the median over the
        shortest tenth.
        """
        lengths = sorted(s.dt_s for s in self._spacings if s.dt_s > 0)
        if len(lengths) < 3:
            return float("inf")
        usual, short = lengths[len(lengths) // 2], lengths[(len(lengths) - 1) // 10]
        return usual * min(max(GAP, usual / short), _IRREGULAR)

    def _not_counted(self, gap: _Spacing, notes: list[str]) -> float:
        """The revolutions of a gap that are not to be counted, and a note of it."""
        counted = self._gaps == "running" and gap.turns > 0
        how = f"counted at {gap.speed_rpm:.0f} rpm" if counted else "not counted"
        notes.append(f"gap of {gap.dt_s:.6g} s before time_s = {gap.time_s:.6g}: its revolutions are {how}")
        return 0.0 if counted else gap.turns
