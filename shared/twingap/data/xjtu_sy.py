"""XJTU-SY: fifteen UER204 bearings run to failure under three conditions.

<root>/xjtu_sy/35Hz12kN/Bearing1_1/1.csv: Horizontal_vibration_signals,Vertical_vibration_signals; 32,768 rows, 25.6 kHz
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

from twingap.bearing import BEARINGS
from twingap.data.lazy import Each
from twingap.data.manifest import manifest_of
from twingap.data.resample import resampled
from twingap.data.root import data_root, not_at_hand
from twingap.errors import TwingapError
from twingap.records import Array, Condition, RecordSet
from twingap.records.samples import load as load_samples

Axis = Literal["horizontal", "vertical"]
_COLUMN: Final = {"horizontal": "Horizontal_vibration_signals", "vertical": "Vertical_vibration_signals"}


def load_xjtu_sy(
    root: str | os.PathLike[str] | None = None, *, axis: Axis = "horizontal", fs_hz: float | None = None
) -> RecordSet:
    """Every snapshot of every available run, one record each, in g.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent.
    axis : {"horizontal", "vertical"}
        Accelerometer; the load acts horizontally.
    fs_hz : float or None
        Output sampling rate, Hz; None keeps 25.6 kHz.

    Returns
    -------
    RecordSet
        `fault` is unknown along the run; column end_fault names the parts that had failed at its end, joined by "+".
        `time_s` counts snapshots of 60 s; `group` and bearing_id are the run's bearing; further columns are
        condition and axis.

    Raises
    ------
    NotAtHandError
        When no run is available.
    TwingapError
        On access, when a file is not in the documented form.
    """
    if axis not in _COLUMN:
        raise TwingapError(f"unknown axis {axis!r}", mend="use horizontal or vertical")
    folder, facts = data_root(root), manifest_of("xjtu_sy")
    conditions: list[Condition] = []
    loads: list[partial[Array]] = []
    for run in facts.recordings:
        for number, path in _snapshots(folder / "xjtu_sy", run):
            conditions.append(_condition(run, number, axis))
            loads.append(partial(load_samples, path, _COLUMN[axis]))
    if not conditions:
        raise not_at_hand(facts, folder, "no XJTU-SY run")
    bearing = BEARINGS[facts.bearing or "UER204"]
    # Lengths are not checked here, as that would open thousands of files; reading a file of another length fails.
    records = RecordSet("xjtu_sy", facts.unit, bearing, conditions, Each(tuple(loads)))
    return resampled(records, fs_hz)


def _snapshots(folder: Path, run: Mapping[str, Any]) -> list[tuple[int, Path]]:
    """Number and path of a run's snapshots; an unpacker may have added a folder of the archive's name."""
    for place in (folder / run["folder"], folder / "XJTU-SY_Bearing_Datasets" / run["folder"]):
        if place.is_dir():
            return sorted((int(p.stem), p) for p in place.glob("*.csv") if p.stem.isdecimal())
    return []


def _condition(run: Mapping[str, Any], number: int, axis: Axis) -> Condition:
    bearing_id = run["bearing_id"]
    return Condition(
        name=f"{bearing_id}_{number:04d}",
        speed_rpm=float(run["speed_rpm"]),
        fs_hz=float(run["fs_hz"]),
        n_samples=run["n_samples"],
        load_n=float(run["load_n"]),
        time_s=float((number - 1) * run["snapshot_period_s"]),
        group=bearing_id,
        extra={
            "bearing_id": bearing_id,
            "condition": run["condition"],
            "end_fault": run["end_fault"],
            "axis": axis,
        },
    )
