"""Tacho pulses: missing and double ones, found by their intervals.

pulse times --interval over the median of its neighbours--> missing (2, 3), double (two that add up to 1) --> repaired
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals

_NEIGHBOURS: Final = 4
"""Intervals on either side in the median; more tolerate more faults in a row, and less change of speed."""
_LONG: Final = 1.6
"""Ratio to the neighbours from which pulses are missing. The speed would have to fall to 0.6 of itself and rise again
within a turn."""
_SHORT: Final = 0.4
"""Ratio to the neighbours below which a pulse is one of two."""
_MOST: Final = 0.2
"""Largest share of intervals that may be faulty; pulses found in noise give a quarter."""
_SUM: Final = 0.25
"""How far two intervals with a double pulse between them may add up to something else than one interval."""


@dataclass(frozen=True)
class TachoPulses:
    """Tacho pulses in which missing ones are filled in and double ones are taken out.

    Parameters
    ----------
    times_s : Array [pulses]
    missing : tuple of int
        Intervals, in the given pulses, in which pulses are missing.
    double : tuple of int
        Given pulses that were taken out.
    notes : tuple of str
    """

    times_s: Array
    missing: tuple[int, ...]
    double: tuple[int, ...]
    notes: tuple[str, ...]


def repaired_tacho(pulse_times_s: ArrayLike) -> TachoPulses:
    """Tacho pulses with missing ones filled in, at equal intervals, and double ones taken out.

    Parameters
    ----------
    pulse_times_s : array_like [pulses]
        Ascending, s; at least 2. Fewer than 5 are returned as they are.

    Returns
    -------
    TachoPulses

    Raises
    ------
    TwingapError
        When more than a fifth of the intervals are faulty: no regular train of pulses is left to judge by.
    """
    times = as_signals(pulse_times_s, where="repaired_tacho", at_least=2)
    kept = np.ones(times.size, dtype=bool)
    intervals = np.diff(times)
    usual = _usual(intervals)
    for i in np.flatnonzero(intervals < _SHORT * usual).tolist():
        if not (kept[i] and kept[i + 1]):
            continue
        # A bounce follows its pulse; what comes shortly before one is noise.
        after = i + 1 < intervals.size and abs((intervals[i] + intervals[i + 1]) / usual[i] - 1) < _SUM
        before = i > 0 and abs((intervals[i] + intervals[i - 1]) / usual[i] - 1) < _SUM
        if after or not before:
            kept[i + 1] = False
        else:
            kept[i] = False
    double = tuple(int(i) for i in np.flatnonzero(~kept))
    places = np.flatnonzero(kept)
    times = times[kept]
    intervals = np.diff(times)
    usual = _usual(intervals)
    long = set(np.flatnonzero(intervals > _LONG * usual).tolist())
    parts = [times[:1]]
    missing = []
    for i, interval in enumerate(intervals):
        count = max(1, round(float(interval / usual[i]))) if i in long else 1
        if count > 1:
            missing.append(int(places[i]))
        parts.append(times[i] + interval * np.arange(1, count + 1) / count)
    faults = len(missing) + len(double)
    if faults > _MOST * max(5, intervals.size):
        raise TwingapError(
            f"{faults} of {intervals.size} intervals are irregular: {len(missing)} too long, {len(double)} too short",
            where="tacho pulses", mend="check the threshold by which pulses were found",
        )  # fmt: skip
    filled = np.concatenate(parts)
    notes = []
    if missing:
        notes.append(f"{_count(filled.size - times.size)} missing, the first after pulse {missing[0]}: filled in")
    if double:
        notes.append(f"{_count(len(double))} double, the first is pulse {double[0]}: taken out")
    return TachoPulses(filled, tuple(missing), double, tuple(notes))


def _count(pulses: int) -> str:
    return "1 pulse is" if pulses == 1 else f"{pulses} pulses are"


def _usual(intervals: Array) -> Array:
    """Median of each interval's neighbours [intervals]; the interval itself where there are fewer than 4 in all."""
    if intervals.size < 4:
        return intervals
    usual = np.empty_like(intervals)
    for i in range(intervals.size):
        around: NDArray[np.float64] = np.concatenate(
            (intervals[max(0, i - _NEIGHBOURS) : i], intervals[i + 1 : i + 1 + _NEIGHBOURS])
        )
        usual[i] = np.median(around)
    # At the ends neighbours lie on one side only, where a changing speed tells against the interval.
    usual[0], usual[-1] = max(usual[0], intervals[1]), max(usual[-1], intervals[-2])
    return usual
