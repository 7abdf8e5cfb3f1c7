"""Recordings cut into records of equal length, read on access.

recording of 10 s --cut--> ten records of 1 s, all of the recording's group
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from twingap.data.lazy import Latest
from twingap.errors import TwingapError
from twingap.records import Array, RecordSet


def cut(
    records: RecordSet, *, n_samples: int | None = None, duration_s: float | None = None, step: int | None = None
) -> RecordSet:
    """Cut every record into pieces of equal length; a shorter remainder is dropped.

    Pieces keep the group of their record, so that no split ever puts parts of one recording on both sides.

    Parameters
    ----------
    records : RecordSet
    n_samples : int, optional
        Length of a piece in samples.
    duration_s : float, optional
        Length of a piece in s, rounded to whole samples at each record's rate. Exactly one of the two is given.
    step : int, optional
        Samples from the start of one piece to that of the next; None = the length, so that pieces do not overlap.

    Returns
    -------
    RecordSet
        Names ``<record>+<first sample>``. Where `time_s` is known, it is that of the piece's first sample. A record
        shorter than a piece gives none.

    Raises
    ------
    TwingapError
        When not exactly one length is given, it or the step is not positive, or no record is long enough.
    """
    if (n_samples is None) == (duration_s is None):
        raise TwingapError("a length in samples or in seconds is needed", mend="give n_samples or duration_s, not both")
    if n_samples is not None and n_samples < 1:
        raise TwingapError(f"n_samples = {n_samples}, at least 1 expected")
    if duration_s is not None and not (math.isfinite(duration_s) and duration_s > 0):
        raise TwingapError(f"duration_s = {duration_s!r}, a positive number expected")
    if step is not None and step < 1:
        raise TwingapError(f"step = {step}, at least 1 expected")
    conditions, places = [], []
    for index, condition in enumerate(records.conditions):
        length = n_samples if n_samples is not None else max(1, round((duration_s or 0) * condition.fs_hz))
        for start in range(0, condition.n_samples - length + 1, step or length):
            time_s = None if condition.time_s is None else condition.time_s + start / condition.fs_hz
            conditions.append(
                replace(
                    condition,
                    name=f"{condition.name}+{start}",
                    n_samples=length,
                    time_s=time_s,
                )
            )
            places.append((index, start, length))
    if not conditions:
        longest = max(c.n_samples for c in records.conditions)
        raise TwingapError(f"the longest record has {longest} samples, too few for one piece", where=records.name)
    load = _Pieces(Latest(_Whole(records)), tuple(places))
    return RecordSet(records.name, records.unit, records.bearing, conditions, load)


@dataclass(frozen=True)
class _Whole:
    """Loader of whole records."""

    records: RecordSet

    def __call__(self, index: int) -> Array:
        return self.records[index].samples


@dataclass(frozen=True)
class _Pieces:
    """Loader of piece i; consecutive pieces of one record cost one read."""

    whole: Latest[Array]
    places: tuple[tuple[int, int, int], ...]

    def __call__(self, piece: int) -> Array:
        index, start, length = self.places[piece]
        return self.whole(index)[start : start + length].copy()
