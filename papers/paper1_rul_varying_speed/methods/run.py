"""Run of one bearing, row by row: time, speed, amplitude; and the planned speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from papers.arrays import Array
from twingap import RecordSet, TwingapError
from twingap.prognosis.speed_influence import SAME_SPEED

ALIKE = 0.9
"""Share of rows that must agree with those a period earlier: abrupt changes of a test stand are the rest."""


@dataclass(frozen=True)
class Run:
    """Rows of one run in order of time; raises `TwingapError` where columns differ in length or time does not rise."""

    time_s: Array  # [rows] since the start
    speed_rpm: Array  # [rows] mean over the record
    peak_to_peak: Array  # [rows] of the record's samples, in the unit of its set

    def __post_init__(self) -> None:
        sizes = {self.time_s.shape, self.speed_rpm.shape, self.peak_to_peak.shape}
        if len(sizes) != 1 or self.time_s.ndim != 1 or self.time_s.size < 2:
            raise TwingapError(f"columns of shapes {sorted(sizes)}, two or more rows each expected", where="run")
        if not (np.diff(self.time_s) > 0).all():
            raise TwingapError(
                "does not increase from row to row", where="run: time_s", mend="sort the records by time"
            )

    @property
    def dt_s(self) -> float:
        """Usual time from row to row, s."""
        return float(np.median(np.diff(self.time_s)))

    def until(self, row: int) -> Run:
        """Rows up to and including `row`: what is known when it has been measured."""
        end = row + 1
        return Run(self.time_s[:end], self.speed_rpm[:end], self.peak_to_peak[:end])

    def rows_in(self, minutes: float) -> int:
        """Number of rows at the beginning that lie within so many minutes of the first."""
        return int(np.searchsorted(self.time_s, self.time_s[0] + 60 * minutes, side="left"))


def read_run(records: RecordSet) -> Run:
    """Rows of a run from the records of one bearing in order of time, one in memory at a time; `TwingapError` without
    times."""
    for condition in records.conditions:
        if condition.time_s is None:
            raise TwingapError("has no time_s", where=f"record {condition.name!r}", mend="a run needs times")
    return Run(
        np.array([c.time_s for c in records.conditions], float),
        np.array([c.speed_rpm for c in records.conditions], float),
        np.array([np.ptp(record.samples) for record in records], float),
    )


def period_rows(speed_rpm: ArrayLike) -> int:
    """Rows after which a speed profile [rows] repeats itself: the shortest period that holds every speed seen and after
    which `ALIKE` of all rows come again; 1 for a constant speed, all rows when nothing repeats."""
    speed = np.asarray(speed_rpm, float)
    low, high = float(speed.min()), float(speed.max())
    if high <= low * (1 + SAME_SPEED):
        return 1
    # A period spans the speeds: without that, steps held for long would agree with themselves a row later.
    found, best = 0, ALIKE
    for lag in range(2, speed.size // 2 + 1):
        if found and lag > 1.25 * found:
            break
        last = speed[-lag:]
        if last.min() > low * (1 + SAME_SPEED) or last.max() < high * (1 - SAME_SPEED):
            continue
        alike = float(np.mean(np.abs(speed[lag:] - speed[:-lag]) <= SAME_SPEED * speed[lag:]))
        # Long steps agree nearly as well a few rows too early: on to the top of the hill.
        if alike > best or (not found and alike >= ALIKE):
            found, best = lag, alike
    return found or int(speed.size)


def planned_speed(speed_rpm: ArrayLike, rows: int, period: int) -> Array:
    """A profile seen so far [seen], and on after it [rows]: each planned row repeats the one a `period` before."""
    seen = np.asarray(speed_rpm, float)
    if rows <= seen.size:
        return seen[:rows].copy()
    again = np.resize(seen[seen.size - period :], rows - seen.size)
    return np.concatenate((seen, again))
