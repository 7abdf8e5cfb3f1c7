"""Subsynchronous line: a line below the order of the shaft that the records of all states share.

highest line between two orders in each record --orders of all records--> the order that most records agree on

A belt, another shaft, a whirl or a rub has such a line. A loose part has it at half the shaft's order; lines of a cage
are in the records of a faulty bearing alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from twingap.gap.features.tones.whitened_spectra import Whitened
from twingap.records import Array

_LOW, _HIGH = 0.2, 0.85
"""Orders between which lines are sought. With a wider range, lines of the shaft itself and slow drifts count."""
_FIRST: Final = 3
"""First bin in which a line is sought, so that short records begin at a higher order. In lower ones lie drifts."""
_MAINS_HZ: Final = (50.0, 60.0)
_BESIDE_MAINS: Final = 1.5
"""Distance from multiples of the mains, bins, within which no line is sought. A larger value leaves out more lines."""
_WITHIN: Final = 0.03
"""Distance within which orders agree. A larger value takes lines by chance."""
_FEWEST: Final = 8
"""Smallest number of records in which a line is sought. In fewer, lines agree by chance."""
_TURNS: Final = 8.0
"""Least number of turns in a record. In fewer, there are too few bins below the shaft's order."""


NAMES: Final = ("below_order", "below_error", "below_share", "below_level")


class Subsynchronous(NamedTuple):
    """The line below the shaft's order that most records share."""

    order: float
    error: float  # standard error of the order
    share: float  # part of the records of a state whose highest line it is; of the state that has it least
    level_log: float  # ln of its power over its floor, median of the records that have it


def strongest(records: Sequence[Whitened]) -> Subsynchronous | None:
    """The line below the shaft's order that most records share; None where too few records can show one."""
    long = [record for record in records if record.shaft_hz >= _TURNS * record.df_hz]
    kinds = np.array([record.kind for record in long])
    if len(long) < max(_FEWEST, 0.5 * len(records)) or set(kinds) != {record.kind for record in records}:
        return None
    orders, levels = np.array([_highest(record) for record in long]).T
    agree = np.abs(orders[:, None] - orders) < _WITHIN
    near = agree[int(np.argmax(agree.sum(axis=1)))]
    if near.sum() < 2:
        return None
    share = min(float(near[kinds == kind].mean()) for kind in set(kinds))
    order = float(np.median(orders[near]))
    error = 1.4826 * float(np.median(np.abs(orders[near] - order))) / math.sqrt(near.sum())
    return Subsynchronous(order, error, share, float(np.median(levels[near])))


def measure(records: Sequence[Whitened]) -> Sequence[float]:
    """[NAMES] The line of a set of records; NaN where none can be sought."""
    found = strongest(records)
    return (math.nan,) * len(NAMES) if found is None else found


def _highest(record: Whitened) -> tuple[float, float]:
    """Order of the highest line below the shaft's order, and ln of its power over its floor; NaN without any."""
    unit = record.shaft_hz / record.df_hz
    low, high = max(math.ceil(_LOW * unit), _FIRST), int(_HIGH * unit)
    power: Array = record.logs[: high + 2].astype(float)
    inner = np.arange(low, high + 1)
    mains = np.min([np.abs(inner - np.rint(inner * record.df_hz / hz) * hz / record.df_hz) for hz in _MAINS_HZ], axis=0)
    kept = (mains > _BESIDE_MAINS) | (inner * record.df_hz < _MAINS_HZ[0] / 2)
    peaks = inner[kept & (power[inner] > power[inner - 1]) & (power[inner] >= power[inner + 1])]
    if not peaks.size:
        return math.nan, math.nan
    at = int(peaks[np.argmax(power[peaks])])
    before, here, after = power[at - 1 : at + 2]
    offset = 0.5 * (before - after) / (before - 2 * here + after)  # vertex of a parabola
    return (at + offset) / unit, here
