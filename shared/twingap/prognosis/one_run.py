"""Rows of one run: their order in time, and whether groups of records are recordings of one run or several runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise

from twingap.errors import TwingapError


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


def in_order(times: Sequence[float], names: Sequence[object], where: object) -> tuple[list[int], list[str]]:
    """Places of the rows in order of time, rows of one time as they stand, with notes on what was unusual.

    Parameters
    ----------
    times : sequence of float [rows]
        s from the start of the run.
    names : sequence [rows]
        Of the rows, for messages.
    where : object
        What holds them, for messages.

    Raises
    ------
    TwingapError
        When every time appears more than once: several channels or bearings, and no run.
    """
    order = sorted(range(len(times)), key=lambda place: times[place])
    notes = []
    if order != list(range(len(times))):
        back = sum(later < earlier for earlier, later in pairwise(times))
        notes.append(
            f"rows are not in order of time (time_s goes back {back} {'time' if back == 1 else 'times'}: a clock set "
            "back, or rows out of order): they are taken by time_s"
        )
    same = [b for a, b in pairwise(order) if times[a] == times[b]]
    counts = Counter(times)
    if len(counts) > 1 and min(counts.values()) > 1:
        first = names[order[order.index(same[0]) - 1]]
        raise TwingapError(
            f"{len(same)} of {len(times)} rows have the time of another row, the first are {first!r} and "
            f"{names[same[0]]!r}", where=where,
            mend="give the records of one channel and one bearing",
        )  # fmt: skip
    if same:
        count = f"{len(same)} {'row has' if len(same) == 1 else 'rows have'}"
        notes.append(f"{count} the time of the row before: they are taken as they stand in the table")
    return order, notes


def listed(groups: Sequence[str], most: int = 8) -> str:
    """Names of the first groups, for a message."""
    names = list(dict.fromkeys(groups))
    return ", ".join(names[:most]) + (", ..." if len(names) > most else "")
