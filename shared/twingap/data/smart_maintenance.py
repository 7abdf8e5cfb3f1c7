"""Smart Maintenance (Flanders Make): indented 6205 bearings run to failure at varying speed.

<root>/smart_maintenance/A148/measurements.csv     file, time_s, speed_rpm: a row per measurement
<root>/smart_maintenance/A148/00001.npy (or .csv)  acceleration in g at 50 kHz: a vector, or one column without header

The set is not public and its layout is not published: this layout is ASSUMED, as the minimum that a user with the
data has to provide. Published (paper 1, section 4.1 and table 3) are the bearings A148 to A156, FAG 6205-C-TVH with an
indentation on the inner race, 9 kN, 1000 to 2000 rpm in steps of 100 rpm held for 60 s, 50 kHz, and the end of life at
15 g peak to peak.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from twingap.bearing import BEARINGS
from twingap.data.lazy import Each
from twingap.data.manifest import manifest_of
from twingap.data.resample import resampled
from twingap.data.root import data_root, not_at_hand
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.records.samples import Channel, inspect


def load_smart_maintenance(root: str | os.PathLike[str] | None = None, *, fs_hz: float | None = None) -> RecordSet:
    """Every measurement of every available run, one record each, in g.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent.
    fs_hz : float or None
        Output sampling rate, Hz; None keeps 50 kHz.

    Returns
    -------
    RecordSet
        `fault` is unknown along the run; column end_fault is the location of the indentation. `group` and bearing_id
        are the run's bearing; further columns end_of_life_peak_to_peak_g and anomaly_s (time of the first anomaly that
        the paper's method found, s).

    Raises
    ------
    NotAtHandError
        When no run is available.
    TwingapError
        When a run is not laid out as above; names file, row and column.
    """
    folder, facts = data_root(root), manifest_of("smart_maintenance")
    conditions: list[Condition] = []
    channels: list[Channel] = []
    for run in facts.recordings:
        index = folder / "smart_maintenance" / run["folder"] / "measurements.csv"
        if index.is_file():
            for path, time_s, speed_rpm in _measurements(index):
                channels.append(inspect(path).find())
                conditions.append(_condition(run, channels[-1], time_s, speed_rpm))
    if not conditions:
        raise not_at_hand(facts, folder, "no Smart Maintenance run")
    bearing = BEARINGS[facts.bearing or "6205"]
    loads = tuple(channel.load for channel in channels)
    return resampled(RecordSet("smart_maintenance", facts.unit, bearing, conditions, Each(loads)), fs_hz)


def _measurements(index: Path) -> list[tuple[Path, float, float]]:
    """Path, time and speed of each measurement that the table lists."""
    try:
        table = pd.read_csv(index, dtype=str, keep_default_na=False)
    except (OSError, ValueError) as error:
        raise TwingapError(f"cannot be read as a table: {error}", where=index) from error
    for column in ("file", "time_s", "speed_rpm"):
        if column not in table:
            raise TwingapError(
                f"column {column!r} is missing", where=index, mend="columns file, time_s, speed_rpm are expected"
            )
    found = []
    for row, (name, *texts) in enumerate(table[["file", "time_s", "speed_rpm"]].itertuples(index=False), start=2):
        numbers = []
        for column, text in zip(("time_s", "speed_rpm"), texts, strict=True):
            try:
                number = float(text)
            except ValueError:
                number = math.nan
            if not math.isfinite(number):
                raise TwingapError(f"{column} = {text!r}, a number expected", where=f"{index}, line {row}")
            numbers.append(number)
        path = index.parent / name
        if not name or not path.is_file():
            raise TwingapError(f"file {name!r} does not exist", where=f"{index}, line {row}")
        found.append((path, numbers[0], numbers[1]))
    return found


def _condition(run: Mapping[str, Any], samples: Channel, time_s: float, speed_rpm: float) -> Condition:
    bearing_id = run["bearing_id"]
    return Condition(
        name=f"{bearing_id}_{samples.path.stem}",
        speed_rpm=speed_rpm,
        fs_hz=float(run["fs_hz"]),
        n_samples=samples.n_samples,
        load_n=float(run["load_n"]),
        time_s=time_s,
        group=bearing_id,
        extra={
            "bearing_id": bearing_id,
            "end_fault": run["end_fault"],
            "anomaly_s": 60 * run["anomaly_min"],
            "end_of_life_peak_to_peak_g": run["end_of_life_peak_to_peak_g"],
        },
    )
