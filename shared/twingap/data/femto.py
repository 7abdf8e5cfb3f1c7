"""FEMTO-ST PRONOSTIA: bearings run to failure, the IEEE PHM 2012 challenge.

<root>/femto/Learning_set/Bearing1_1/acc_00001.csv    the owner's: h, m, s, us, horizontal g, vertical g; 2560 rows
<root>/femto/Bearing1_1.npz                           a third party's: horizontal_g [snapshots, 2560]
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from twingap.bearing import BEARINGS
from twingap.data.lazy import Each, Latest
from twingap.data.manifest import manifest_of
from twingap.data.resample import resampled
from twingap.data.root import data_root, not_at_hand
from twingap.data.tables import columns
from twingap.errors import TwingapError
from twingap.records import Array, Condition, RecordSet

Axis = Literal["horizontal", "vertical"]
Snapshots = np.ndarray[Any, np.dtype[np.float32]]
N_SAMPLES: Final = 2560
_COLUMN: Final = {"horizontal": 4, "vertical": 5}
_SNAPSHOT: Final = re.compile(r"acc_(\d+)\.csv")


def load_femto(
    root: str | os.PathLike[str] | None = None, *, axis: Axis = "horizontal", fs_hz: float | None = None
) -> RecordSet:
    """Every snapshot of every available run, one record each, in g.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent.
    axis : {"horizontal", "vertical"}
        Accelerometer. The converted files hold the horizontal one only.
    fs_hz : float or None
        Output sampling rate, Hz; None keeps 25.6 kHz.

    Returns
    -------
    RecordSet
        `fault` is unknown throughout: the failed part is not published. `time_s` counts snapshots of 10 s, since the
        clocks in two files of Bearing1_1 are wrong. `group` and column bearing_id are the run's bearing; further
        columns condition, subset, axis and source (the owner's files, preferred where present, or the conversion).

    Raises
    ------
    NotAtHandError
        When no run is available.
    TwingapError
        When a file cannot be read.
    """
    if axis not in _COLUMN:
        raise TwingapError(f"unknown axis {axis!r}", mend="use horizontal or vertical")
    folder, facts = data_root(root), manifest_of("femto")
    converted = Latest(_horizontal)
    conditions: list[Condition] = []
    loaders: list[Callable[[], Array]] = []
    for run in facts.recordings:
        snapshots = _owner_files(folder / "femto", run)
        npz = folder / run["converted_file"] if "converted_file" in run else None
        if snapshots:
            for number, path in snapshots:
                conditions.append(_condition(run, number, N_SAMPLES, axis, "original"))
                loaders.append(partial(_from_text, path, _COLUMN[axis]))
        elif npz is not None and npz.is_file() and axis == "horizontal":
            n_snapshots, n_samples = converted(npz).shape
            for row in range(n_snapshots):
                conditions.append(_condition(run, row + 1, n_samples, axis, f"third-party conversion {npz.name}"))
                loaders.append(partial(_from_npz, converted, npz, row))
    if not conditions:
        raise not_at_hand(facts, folder, f"no FEMTO run with the {axis} accelerometer")
    bearing = BEARINGS[facts.bearing or "PRONOSTIA"]
    return resampled(RecordSet("femto", facts.unit, bearing, conditions, Each(tuple(loaders))), fs_hz)


def _owner_files(folder: Path, run: Mapping[str, Any]) -> list[tuple[int, Path]]:
    """Number and path of a run's snapshots in the owner's layout, with or without the subset's folder."""
    for place in (folder / run["folder"], folder / run["bearing_id"]):
        if place.is_dir():
            found = [(int(m[1]), p) for p in place.iterdir() if (m := _SNAPSHOT.fullmatch(p.name))]
            if found:
                return sorted(found)
    return []


def _from_text(path: Path, column: int) -> Array:
    samples: Array = columns(path, 6)[column]
    return samples


def _from_npz(converted: Latest[Snapshots], path: Path, row: int) -> Array:
    return np.array(converted(path)[row], dtype=np.float64)


def _horizontal(path: Path) -> Snapshots:
    try:
        with np.load(path, allow_pickle=False) as archive:
            snapshots: Snapshots = archive["horizontal_g"]
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise TwingapError(f"cannot be read: {error}", where=path, mend="verify the data set") from error
    except Exception as error:  # zipfile and zlib errors of a broken archive
        raise TwingapError(f"is broken: {error}", where=path, mend="verify the data set") from error
    if snapshots.ndim != 2:
        raise TwingapError(f"horizontal_g has shape {snapshots.shape}, [snapshots, samples] expected", where=path)
    return snapshots


def _condition(run: Mapping[str, Any], number: int, n_samples: int, axis: Axis, source: str) -> Condition:
    bearing_id = run["bearing_id"]
    return Condition(
        name=f"{bearing_id}_{number:05d}",
        speed_rpm=float(run["speed_rpm"]),
        fs_hz=float(run["fs_hz"]),
        n_samples=n_samples,
        load_n=float(run["load_n"]),
        time_s=float((number - 1) * run["snapshot_period_s"]),
        group=bearing_id,
        extra={
            "bearing_id": bearing_id,
            "condition": run["condition"],
            "subset": run["subset"],
            "axis": axis,
            "source": source,
        },
    )
