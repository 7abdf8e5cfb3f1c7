"""Run of one bearing, row by row: time, speed, amplitude; the planned speed; remaining life in revolutions and in time.

A bearing wears by the revolution: remaining revolutions fall smoothly whatever the speed does, and remaining time jumps
with it (eq. 14, section 3.6 of paper 1). At constant speed remaining time has slope -1.
"""

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


def remaining_revolutions(speed_rpm: ArrayLike, dt_s: float) -> Array:
    """Rev_n of eq. 14 [rows], from the anomaly (row 0) to the end of life, where it is 0; `dt_s` is the spacing of
    rows. As printed rpm_K dt revolutions would remain at the end, since the total is summed from K_anomaly and
    subtracted from the row after it; that term is left out."""
    speed = np.asarray(speed_rpm, float)
    if speed.ndim != 1 or speed.size == 0 or not np.isfinite(speed).all() or (speed < 0).any():
        raise TwingapError("one finite speed of at least 0 per row expected", where="speed profile")
    turns = speed * (dt_s / 60)
    return np.asarray(np.cumsum(turns[::-1])[::-1] - turns)


def remaining_time_s(revolutions: ArrayLike, speed_rpm: ArrayLike) -> Array:
    """RUL_n = Rev_n / rpm_n of eq. 14, s [...]: the time left at the present speed; infinite for a machine at
    standstill."""
    left, speed = np.broadcast_arrays(np.asarray(revolutions, float), np.asarray(speed_rpm, float))
    running = speed > 0
    time = 60 * left / np.where(running, speed, 1.0)
    return np.where(running, time, np.where(left > 0, np.inf, 0.0))
