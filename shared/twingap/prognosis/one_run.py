"""Test of whether groups of records are recordings of one run, or runs of several bearings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise


def side_by_side(groups: Iterable[str | None], times: Iterable[float | None]) -> bool:
    """Whether groups overlap in time.

    Recordings of one run follow one another, whereas the times of several runs each begin at their own start.

    Parameters
    ----------
    groups : iterable of str or None [rows]
        Group of each row; None = no group.
    times : iterable of float or None [rows]
        Time from the start of a run, s.
    """
    spans: dict[str, list[float]] = {}
    for group, time_s in zip(groups, times, strict=True):
        if group is not None and time_s is not None:
            spans.setdefault(group, []).append(time_s)
    from_to = sorted((min(own), max(own)) for own in spans.values() if len(own) > 1)
    return any(later[0] < earlier[1] for earlier, later in pairwise(from_to))


def listed(groups: Sequence[str], most: int = 8) -> str:
    """Names of the first groups, for a message."""
    names = list(dict.fromkeys(groups))
    return ", ".join(names[:most]) + (", ..." if len(names) > most else "")
