"""Length of a classifier's windows: about five turns of the slowest shaft."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet

WANTED_TURNS: Final = 5.0
LEAST_TURNS: Final = 3.0
"""Desired and smallest number of turns of the shaft in a window. With fewer, orders of different faults are in the same
bin of the envelope spectrum."""
SHORTEST_WINDOW: Final = 512
LONGEST_WINDOW: Final = 16384
"""Range of window lengths, samples. Longer windows need more time and memory."""
FAULTS: Final = ("inner", "outer", "ball")


def window_samples(records: RecordSet, bearing: Bearing) -> int:
    """Length of the windows of a record set.

    Parameters
    ----------
    records : RecordSet
    bearing : Bearing

    Returns
    -------
    int
        The smallest power of two with at least `WANTED_TURNS` of the slowest shaft, or the largest that fits into the
        shortest record.

    Raises
    ------
    TwingapError
        For several sampling rates, a rate too low for the impacts of a fault, and too short records.
    """
    return length_for(records.conditions, bearing, where=f"record set {records.name!r}")


def length_for(conditions: Sequence[Condition], bearing: Bearing, *, where: str) -> int:
    """`window_samples` from the conditions of the records alone.

    Parameters
    ----------
    conditions : sequence of Condition
    bearing : Bearing
    where : str
        Name of the records in the error for several sampling rates.
    """
    rates = sorted({c.fs_hz for c in conditions})
    if len(rates) > 1:
        raise TwingapError(
            f"sampled at {', '.join(f'{r:g}' for r in rates[:4])} Hz, one rate for all expected",
            where=where,
            mend="classify the records of each rate separately, or resample them",
        )
    slowest = min(conditions, key=lambda c: c.speed_rpm)
    fastest = max(conditions, key=lambda c: c.speed_rpm)
    impacts_hz = max(bearing.fault_order(f) for f in FAULTS) * fastest.speed_rpm / 60
    if rates[0] < 8 * impacts_hz:
        raise TwingapError(
            f"is sampled at {rates[0]:g} Hz, at least {8 * impacts_hz:.0f} Hz expected: a fault would cause "
            f"{impacts_hz:.0f} impacts per second",
            where=f"record {fastest.name!r}",
            mend="correct fs_hz or speed_rpm, or record at a higher rate",
        )
    per_turn = rates[0] * 60 / slowest.speed_rpm
    wanted = _power_of_two(WANTED_TURNS * per_turn)
    shortest = min(conditions, key=lambda c: c.n_samples)
    length = min(wanted, LONGEST_WINDOW, 1 << (shortest.n_samples.bit_length() - 1))
    least = _power_of_two(LEAST_TURNS * per_turn)
    if least > LONGEST_WINDOW:
        raise TwingapError(
            f"has {per_turn:.0f} samples per turn, at most {LONGEST_WINDOW / LEAST_TURNS:.0f} expected",
            where=f"record {slowest.name!r}",
            mend="correct fs_hz or speed_rpm, or resample the records to a lower rate",
        )
    if length < least:
        raise TwingapError(
            f"has {shortest.n_samples} samples, at least {least} expected: the power of two with "
            f"{LEAST_TURNS:g} turns of the slowest shaft",
            where=f"record {shortest.name!r}",
            mend="use longer records, or leave it out",
        )
    return length


def _power_of_two(samples: float) -> int:
    """Smallest power of two with at least `samples` and `SHORTEST_WINDOW`."""
    return max(SHORTEST_WINDOW, 1 << math.ceil(math.log2(samples)))
