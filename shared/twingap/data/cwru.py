"""Case Western Reserve University bearing data: drive-end faults at 12 kHz, normal baseline at 48 kHz.

<root>/cwru/105.mat: X105_DE_time, X105_FE_time, X105_BA_time [samples, 1] in g, X105RPM where present

Every combination of fault type and size is ONE bearing, mounted once, and every file is one recording: `group` is the
recording (the default for splits), the column `bearing_id` names the bearing for the stricter split.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from twingap.bearing import BEARINGS
from twingap.data.lazy import Each
from twingap.data.manifest import Manifest, manifest_of
from twingap.data.resample import resampled
from twingap.data.root import data_root, not_at_hand
from twingap.errors import TwingapError
from twingap.records import Array, Condition, RecordSet
from twingap.records.samples import inspect

Channel = Literal["DE", "FE", "BA"]
Loader = Callable[[], Array]


def load_cwru(
    root: str | os.PathLike[str] | None = None, *, channel: Channel = "DE", fs_hz: float | None = 12_000.0
) -> RecordSet:
    """Every available recording, one record each, in g.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent.
    channel : {"DE", "FE", "BA"}
        Accelerometer: drive end, fan end or base. Recordings without it are left out.
    fs_hz : float or None
        Output sampling rate, Hz: the 48 kHz normal baseline is decimated by 4 to the faults' 12 kHz with a zero-phase
        FIR filter. None keeps each recording's own rate.

    Returns
    -------
    RecordSet
        Extra columns: load_hp, fault_size_inch, fault_position (outer race), bearing_id, end, source. `source` is
        "original", or names a third party's conversion: 99_repacked.mat (same samples) for 99.mat,
        98_windows_48k.npy for 98.mat (100 overlapping windows of one recording, in one group; drive end only). An
        official file is preferred where present. `load_n` stays empty: the owner gives motor load in hp only.

    Raises
    ------
    NotAtHandError
        When no recording with this channel is available.
    TwingapError
        When a file cannot be read.
    """
    if channel not in ("DE", "FE", "BA"):
        raise TwingapError(f"unknown channel {channel!r}", mend="use DE (drive end), FE (fan end) or BA (base)")
    folder, facts = data_root(root), manifest_of("cwru")
    conditions: list[Condition] = []
    loaders: list[Loader] = []
    for recording in facts.recordings:
        for condition, loader in _recording(folder, facts, dict(recording), channel):
            conditions.append(condition)
            loaders.append(loader)
    if not conditions:
        raise not_at_hand(facts, folder, f"no CWRU recording with channel {channel}")
    records = RecordSet("cwru", facts.unit, BEARINGS[facts.bearing or "6205"], conditions, Each(tuple(loaders)))
    return resampled(records, fs_hz)


def _recording(
    root: Path, facts: Manifest, recording: dict[str, Any], channel: Channel
) -> list[tuple[Condition, Loader]]:
    """Conditions and loaders of one recording, from the official file or else from its conversion."""
    official = root / recording["file"]
    if official.is_file():
        return _from_mat(official, recording, channel, "original")
    for other in facts.files:
        path = root / other.path
        if other.stands_in_for == recording["file"] and path.is_file():
            source = f"third-party conversion {path.name}"
            if path.suffix == ".npy":
                return _from_windows(path, recording, source) if channel == "DE" else []
            return _from_mat(path, recording, channel, source)
    return []


def _from_mat(path: Path, recording: dict[str, Any], channel: Channel, source: str) -> list[tuple[Condition, Loader]]:
    # 99.mat also holds the arrays of 98, so keys are chosen by number, not by suffix.
    prefix = f"X{int(recording['recording']):03d}"
    file = inspect(path)
    held = [c.name for c in file.channels if c.name.startswith(prefix)]
    if held and f"{prefix}_{channel}_time" not in held:
        return []  # for example, BA is missing from the normal baseline
    samples = file.find(f"{prefix}_{channel}_time")
    speed_rpm = float(recording["nominal_speed_rpm"])
    if f"{prefix}RPM" in held:
        speed_rpm = float(file.find(f"{prefix}RPM").load()[0])
    condition = _condition(recording["recording"], samples.n_samples, speed_rpm, recording, channel, source)
    return [(condition, samples.load)]


def _from_windows(path: Path, recording: dict[str, Any], source: str) -> list[tuple[Condition, Loader]]:
    n_windows, length = _windows(path).shape
    speed_rpm, number = float(recording["nominal_speed_rpm"]), recording["recording"]
    return [
        (_condition(f"{number}_{row:03d}", length, speed_rpm, recording, "DE", source), partial(_window, path, row))
        for row in range(n_windows)
    ]


def _windows(path: Path) -> np.ndarray[Any, np.dtype[Any]]:
    try:
        windows = np.lib.format.open_memmap(path, mode="r")  # refuses pickled objects and all but .npy
    except (OSError, ValueError, EOFError) as error:
        raise TwingapError(f"cannot be read as an array: {error}", where=path, mend="verify the data set") from error
    if windows.ndim != 2:
        raise TwingapError(f"has shape {windows.shape}, [windows, samples] expected", where=path)
    return windows


def _window(path: Path, row: int) -> Array:
    return np.array(_windows(path)[row], dtype=np.float64)


def _condition(
    name: str, n_samples: int, speed_rpm: float, recording: dict[str, Any], channel: Channel, source: str
) -> Condition:
    extra = {
        "load_hp": recording["load_hp"],
        "fault_size_inch": recording["fault_size_inch"],
        "fault_position": recording.get("fault_position"),
        "bearing_id": recording["bearing_id"],
        "end": channel,
        "source": source,
    }
    return Condition(
        name=name,
        speed_rpm=speed_rpm,
        fs_hz=float(recording["fs_hz"]),
        n_samples=n_samples,
        fault=recording["fault"],
        group=recording["recording"],
        extra=extra,
    )
