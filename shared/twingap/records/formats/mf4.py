""".mf4 files (ASAM MDF 4): a channel per signal that is not a time axis, by name, or `2/name` where names repeat."""

from __future__ import annotations

import contextlib
import functools
import logging
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from twingap.records.formats.base import MOST_SAMPLES, Contents, Entry, Format, needed_for


def _signals(file: Any) -> list[tuple[str, int, int]]:
    """Name, group and index of each signal."""
    found = [
        (channel.name, g, i)
        for g, group in enumerate(file.groups)
        for i, channel in enumerate(group.channels)
        if i != file.masters_db.get(g)
    ]
    counts = Counter(name for name, _, _ in found)
    return [(name if counts[name] == 1 else f"{g}/{name}", g, i) for name, g, i in found]


@functools.cache
def _silence() -> None:
    """Keep asammdf from logging, and its finalisers from printing a traceback, for each damaged file."""
    logging.getLogger("asammdf").disabled = True
    from asammdf.blocks import mdf_v3, mdf_v4

    for kind in (mdf_v3.MDF3, mdf_v4.MDF4):
        kind.__del__ = _finaliser(kind.__del__)


def _finaliser(close: Callable[[Any], None]) -> Callable[[Any], None]:
    def finalise(file: Any) -> None:
        with contextlib.suppress(Exception):
            close(file)

    return finalise


def _open(path: Path) -> Any:
    with needed_for(".mf4", "asammdf"):
        from asammdf import MDF
    _silence()
    return MDF(str(path), use_display_names=False)


def _inspect(path: Path) -> Contents:
    entries, rates = [], set()
    with _open(path) as file:
        for name, g, i in _signals(file):
            n = int(file.groups[g].channel_group.cycles_nr)
            problem = f"states {n} values, at most {MOST_SAMPLES} are read" if n > MOST_SAMPLES else None
            unit = str(file.get_channel_unit(group=g, index=i) or "")
            entries.append(Entry(name, n, problem, unit=unit))
            if problem is None and (rate := _rate(file, g, n)):
                rates.add(rate)
    return Contents(tuple(entries), fs_hz=rates.pop() if len(rates) == 1 else None)


def _rate(file: Any, group: int, n: int) -> float | None:
    """Sampling rate of a group whose time axis is even, Hz."""
    if file.masters_db.get(group) is None or n < 3:
        return None
    time = np.asarray(file.get_master(group, record_offset=0, record_count=min(n, 1000)), dtype=np.float64)
    steps = np.diff(time)
    if time.size < 3 or not (steps > 0).all() or np.ptp(steps) > 0.01 * steps.mean():
        return None
    return round(float((time.size - 1) / (time[-1] - time[0])), 6)


def _load(path: Path, name: str, place: int) -> Any:
    with _open(path) as file:
        _, group, index = _signals(file)[place]
        return file.get(group=group, index=index, ignore_invalidation_bits=False).samples


MF4 = Format(_inspect, _load)
