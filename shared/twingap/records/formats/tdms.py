""".tdms files of LabVIEW and DIAdem: a channel per channel, as `group/channel`."""

from __future__ import annotations

import functools
import logging
from pathlib import Path
from typing import Any

from twingap.records.formats.base import MOST_SAMPLES, Contents, Entry, Format, needed_for, not_real


@functools.cache
def _package() -> Any:
    """npTDMS, without its warnings about damaged files."""
    with needed_for(".tdms", "npTDMS"):
        import nptdms
        from nptdms.log import log_manager
    log_manager.set_level(logging.ERROR)
    return nptdms


def _inspect(path: Path) -> Contents:
    tdms = _package()
    entries, rates = [], set()
    with path.open("rb") as stream:  # a stream, so that no index file beside it is used
        for group in tdms.TdmsFile.read_metadata(stream).groups():
            for channel in group.channels():
                n, problem = len(channel), not_real(channel.dtype)
                if n > MOST_SAMPLES:
                    problem = f"states {n} values, at most {MOST_SAMPLES} are read"
                step = channel.properties.get("wf_increment")
                if isinstance(step, (int, float)) and step > 0:
                    rates.add(1 / float(step))
                unit = str(channel.properties.get("unit_string", ""))
                entries.append(Entry(f"{group.name}/{channel.name}", n, problem, unit=unit))
    return Contents(tuple(entries), fs_hz=rates.pop() if len(rates) == 1 else None)


def _load(path: Path, name: str, place: int) -> Any:
    tdms = _package()
    with path.open("rb") as stream, tdms.TdmsFile.open(stream) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        return channels[place][:]


TDMS = Format(_inspect, _load)
