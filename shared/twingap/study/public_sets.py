"""Public record sets of the study, and findings of the literature on single recordings.

data.load --> recordings --a few pieces of 1 s each--> RecordSet --halves, by recording--> one half | the other
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from twingap.data import NotAtHandError, cut, load
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet

PIECE_S: Final = 1.0
"""Length of a record, s; longer gives fewer records with finer spectra."""
SURROGATES: Final[Mapping[str, str]] = {"cwru": "virtual_cwru"}
"""Public set -> the virtual rig that replaces it where its records are not available."""
NEAR_SPEEDS: Final = 1.1
"""Largest ratio of speeds at which recordings of one bearing count as interchangeable; larger allows more halvings by
recording."""
SINGLE: Final = "cwru"
"""The data set whose single recordings the literature describes."""


@dataclass(frozen=True)
class PublicSet:
    """A set of records and its origin."""

    records: RecordSet  # pieces of one length; group = recording
    title: str  # label of all results: "CWRU", or "virtual rig, not CWRU"
    real: bool  # whether the records are measured; False for a virtual rig


def public_set(name: str, root: str | None, pieces: int, piece_s: float = PIECE_S) -> PublicSet:
    """A public set, cut into pieces and in memory; a virtual rig where its records are not available.

    Parameters
    ----------
    name : str
        "cwru" or "hit_sm", or another reader of `twingap.data` whose records have fault labels.
    root : str or None
        Data root; TWINGAP_DATA when None.
    pieces : int
        Pieces of each recording, evenly spaced.
    piece_s : float
        Length of a piece, s.

    Raises
    ------
    TwingapError
        When the records cannot be read, are not available and have no surrogate, or `root` is given without them.
    """
    return _read(name, root, os.environ.get("TWINGAP_DATA"), pieces, piece_s)


@lru_cache(maxsize=4)
def _read(name: str, root: str | None, default_root: str | None, pieces: int, piece_s: float) -> PublicSet:
    """`public_set` with the default data root as an argument, since the cache depends on it."""
    try:
        records, title, real = load(name, root), name.upper().replace("_", "-"), True
    except NotAtHandError:
        if root is not None or name not in SURROGATES:
            raise
        records, real = load(SURROGATES[name]), False
        title = f"virtual rig, not {name.upper()}"
    return PublicSet(_pieces(records, pieces, piece_s), title, real)


def _pieces(records: RecordSet, pieces: int, piece_s: float) -> RecordSet:
    """At most `pieces` pieces of every recording that is long enough for one."""
    long = records.select(lambda c: c.duration_s >= piece_s and c.fault is not None)
    every = cut(long, duration_s=piece_s)
    places: dict[str, list[int]] = {}
    for place, condition in enumerate(every.conditions):
        places.setdefault(str(condition.group), []).append(place)
    kept: list[int] = []
    for own in places.values():
        spread = np.linspace(0, len(own) - 1, min(pieces, len(own))).round().astype(int)
        kept += [own[i] for i in np.unique(spread)]
    return RecordSet.from_records(records.name, records.unit, records.bearing, every.take(kept))


def bearing_of(condition: Condition) -> tuple[str, str]:
    """Fault and bearing: recordings that agree in both differ in load or speed only."""
    return str(condition.fault), str(condition.extra.get("bearing_id", ""))


def halves(records: RecordSet, rng: np.random.Generator) -> tuple[RecordSet, RecordSet, str]:
    """Two random halves that contain the same bearings, split by recording where recordings are interchangeable.

    Each bearing's recordings are sorted by speed and assigned in pairs, at random within a pair; the odd one of a
    bearing goes to the half that did not get the last odd one. Where a bearing's recordings differ in speed by more
    than `NEAR_SPEEDS`, or there is only one, a split by recording would itself make the halves differ. Then every
    recording is cut in the middle of its pieces, and the assignment of its two parts is random.

    Returns
    -------
    RecordSet, RecordSet
    str
        "recording", or "time within recordings", which is optimistic: both halves are of the same recordings.

    Raises
    ------
    TwingapError
        When recordings of one piece would have to be cut.
    """
    groups: dict[str, list[int]] = {}
    for place, condition in enumerate(records.conditions):
        groups.setdefault(str(condition.group), []).append(place)
    by_bearing: dict[tuple[str, str], list[str]] = {}
    for group, places in groups.items():
        by_bearing.setdefault(bearing_of(records.conditions[places[0]]), []).append(group)

    def speed(group: str) -> float:
        return float(np.mean([records.conditions[i].speed_rpm for i in groups[group]]))

    parts: tuple[list[int], list[int]] = ([], [])
    alike = all(
        len(own) > 1 and max(map(speed, own)) <= NEAR_SPEEDS * min(map(speed, own)) for own in by_bearing.values()
    )
    if alike:
        spare = int(rng.integers(2))
        for own in by_bearing.values():
            ordered = sorted(own, key=lambda group: (speed(group), group))
            for pair in range(0, len(ordered), 2):
                both = ordered[pair : pair + 2]
                first = int(rng.integers(2))
                if len(both) == 1:
                    first, spare = spare, 1 - spare
                for turn, group in enumerate(both):
                    parts[(first + turn) % 2].extend(groups[group])
    else:
        for group, places in groups.items():
            if len(places) < 2:
                raise TwingapError(
                    "one piece cannot be halved",
                    where=f"recording {group!r}",
                    mend="take more pieces of each recording",
                )
            first, middle = int(rng.integers(2)), len(places) // 2
            parts[first].extend(places[:middle])
            parts[1 - first].extend(places[middle:])
    one, other = (records.take(sorted(part)) for part in parts)
    return one, other, "recording" if alike else "time within recordings"


# ------------------------------------------------------------------------------------------- findings of the literature


@dataclass(frozen=True)
class Documented:
    """A finding of the literature on single CWRU recordings."""

    finding: str
    # Numbers of recordings of the drive end at 12 kHz; empty where they could not be verified.
    recordings: tuple[str, ...]
    # Indicator that should confirm it: "fault unclear", "clipping", "bursts", "looseness", "rate", "".
    shows: str
    source: str  # reference, and the extent to which it could be verified


_SMITH: Final = "W. A. Smith, R. B. Randall, MSSP 64-65 (2015) 100-131, doi:10.1016/j.ymssp.2015.04.021"
_SMITH_UNCHECKED: Final = f"{_SMITH}; cited without access to the paper"


def _numbers(*firsts: int) -> tuple[str, ...]:
    """Numbers of the recordings at 0, 1, 2, 3 hp."""
    return tuple(str(first + hp) for first in firsts for hp in range(4))


DOCUMENTED: Final[tuple[Documented, ...]] = (
    Documented(
        "most recordings of ball faults do not show the ball's classical signature", _numbers(118, 185, 222),
        "fault unclear", _SMITH_UNCHECKED,
    ),
    Documented(
        "the outer-race fault of 0.014 in can hardly be diagnosed, unlike the smaller and the larger one",
        _numbers(197), "fault unclear", _SMITH_UNCHECKED,
    ),
    Documented(
        "the inner-race fault of 0.014 in is among the difficult ones", _numbers(169), "fault unclear",
        f"{_SMITH_UNCHECKED}; this citation is less certain",
    ),
    Documented(
        "some recordings are clipped", (), "clipping",
        f"{_SMITH_UNCHECKED}; the numbers of the recordings are not known",
    ),
    Documented(
        "some recordings hold patches of electrical noise", (), "bursts",
        f"{_SMITH_UNCHECKED}; the numbers of the recordings are not known, they may be of the fan end only",
    ),
    Documented(
        "some recordings show mechanical looseness: orders of the shaft and their modulation stand above the fault's",
        (), "looseness", f"{_SMITH_UNCHECKED}; the numbers of the recordings are not known",
    ),
    Documented(
        "the healthy recordings were sampled at 48 kHz, the faults at 12 kHz: healthy and faulty records went through "
        "other filters", ("97", "98", "99", "100"), "rate", "the owner's tables and the files themselves",
    ),
)  # fmt: skip
"""Findings that could be stated without access to the paper; not a complete list."""


def documented(recording: str) -> tuple[Documented, ...]:
    """Findings on one recording, by its number."""
    return tuple(d for d in DOCUMENTED if recording in d.recordings)
