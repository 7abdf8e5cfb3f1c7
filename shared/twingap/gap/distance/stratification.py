"""Strata of records of like condition, independent units within them, and common slopes over speed, load and time.

conditions --fault, speed, load, time--> strata --groups--> units --places on log speed, load, time--> slopes
rows of units less their strata's means and the slopes --> residuals: scatter
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array, Condition

Places = NDArray[np.int64]

NUMBERS: Final = ("speed_rpm", "load_n", "time_s")
"""Numbers of a condition over which a gap may vary, in the order in which they are tried."""
_VARIES: Final = 0.05
"""Part of its mean by which speed, load or time must vary to get strata, a slope, or a contrast."""
_MOST_INTERVALS: Final = 3
"""Largest number of intervals of a fault's records. More show gaps of narrower ranges, with fewer records each."""
_FEWEST: Final = 3
"""Smallest number of records of an interval. A larger number gives fewer strata, with less noise each."""
_FREE: Final = 5
"""Smallest number of degrees of freedom within strata per slope. With fewer, scatter is taken for a trend."""


def strata(conditions: Sequence[Condition]) -> tuple[Places, ...]:
    """Strata: records by fault, then in intervals of the first of speed, load and time that varies.

    Every place in `conditions` is in one of them. Faults of a single record join the largest stratum.
    """
    faults, groups = [c.fault or "" for c in conditions], [c.group for c in conditions]
    parts: list[Places] = []
    for fault in dict.fromkeys(faults):
        own = np.array([i for i, f in enumerate(faults) if f == fault])
        # The first of speed, load and time that varies.
        known = (known_values([[conditions[i]] for i in own], name) for name in NUMBERS)
        values = next((v for v in known if v is not None and varies(v)), None)
        count = min(_MOST_INTERVALS, max(len(own) // _FEWEST, 1))
        if values is None or count == 1:
            parts.append(own)
            continue
        order = own[np.argsort(values, kind="stable")]
        cut: list[int] = []
        at = np.sort(values)
        for part in np.array_split(np.arange(len(own)), count)[1:]:
            # Records of one speed stay together, and those of one recording.
            first = int(np.searchsorted(at, at[part[0]]))
            while first > 0 and groups[order[first]] is not None and groups[order[first]] == groups[order[first - 1]]:
                first -= 1
            if min(first, len(own) - first, first - cut[-1] if cut else first) >= _FEWEST:
                cut.append(first)
        parts.extend(np.split(order, cut))
    lonely = [p for p in parts if len(p) < 2]
    if lonely and len(parts) > 1:
        others = [p for p in parts if len(p) >= 2]
        if not others:
            return (np.arange(len(conditions)),)
        largest = max(range(len(others)), key=lambda i: len(others[i]))
        others[largest] = np.concatenate([others[largest], *lonely])
        return tuple(others)
    return tuple(parts)


def known_values(units: Sequence[Sequence[Condition]], name: str) -> Array | None:
    """[units] Means of a field of the records of each unit; None where it is unknown of any."""
    values = [[getattr(c, name) for c in unit] for unit in units]
    if any(v is None for unit in values for v in unit):
        return None
    return np.array([np.mean(unit) for unit in values], float)


def varies(values: Array) -> bool:
    """Whether values differ by more than `_VARIES` of their mean size."""
    return bool(np.ptp(values) > _VARIES * max(float(np.abs(values).mean()), 1e-12))


def slopes(strata: Sequence[Sequence[Sequence[Condition]]]) -> tuple[Array, ...]:
    """Per stratum [units, slopes]: places of units, given by their records, on common slopes of all strata.

    Centred in each stratum, orthonormal over all; one slope for each of log speed, load and time (in this order) that
    varies within strata, as far as there are `_FREE` degrees of freedom for each.
    """
    counts = [len(units) for units in strata]
    most = (sum(counts) - len(counts)) // _FREE
    found: list[Array] = []
    for name in NUMBERS:
        v = known_values([unit for units in strata for unit in units], name)
        if len(found) == most or v is None or not varies(v):
            continue
        v = np.log(v) if name == "speed_rpm" else v / np.abs(v).max()
        own = np.concatenate([part - part.mean() for part in np.split(v, np.cumsum(counts)[:-1])])
        size = float(np.linalg.norm(own))
        for other in found:
            own = own - (own @ other) * other
        left = float(np.linalg.norm(own))
        # A variable that varies between strata only, or together with another, has no separate slope.
        if size > _VARIES * max(float(np.linalg.norm(v - v.mean())), 1e-12) and left > 0.1 * size:
            found.append(own / left)
    table = np.array(found).reshape(len(found), sum(counts)).T
    return tuple(np.split(table, np.cumsum(counts)[:-1]))


def detrended(rows: Sequence[Array], tilts: Sequence[Array]) -> tuple[list[Array], Array]:
    """Residuals of rows from their strata's means and common slopes, and the slopes [slopes, bins]."""
    inner = [own - own.mean(axis=0) for own in rows]
    steepness = np.sum([tilt.T @ own for tilt, own in zip(tilts, inner, strict=True)], axis=0)
    return [own - tilt @ steepness for tilt, own in zip(tilts, inner, strict=True)], np.asarray(steepness)


def independent_units(conditions: Sequence[Condition]) -> list[Places]:
    """Places of the records of each independent unit: a group, or single records where the stratum has one group.

    Windows of one recording share its systematic deviations and are not independent.
    """
    names = list(dict.fromkeys(c.group for c in conditions))
    if not 1 < len(names) < len(conditions):
        return [np.array([i]) for i in range(len(conditions))]
    return [np.array([i for i, c in enumerate(conditions) if c.group == name]) for name in names]
