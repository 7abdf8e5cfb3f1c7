"""IMS Center: three tests to failure of four ZA-2115 bearings on one shaft.

<root>/ims/2nd_test/2004.02.12.10.32.39          the owner's snapshots: 20,480 rows, 4 columns (test 1: 8), 20 kHz
<root>/ims/set2_time_features.csv                a third party's features per snapshot, bearing and channel
<root>/ims/set2_shape_spectral_features.csv
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, Final

import pandas as pd

from twingap.bearing import BEARINGS
from twingap.data.lazy import Each, Latest
from twingap.data.manifest import manifest_of
from twingap.data.resample import resampled
from twingap.data.root import NotAtHandError, data_root, not_at_hand
from twingap.data.tables import columns
from twingap.errors import TwingapError
from twingap.records import Array, Condition, RecordSet

N_SAMPLES: Final = 20_480
_SNAPSHOT: Final = re.compile(r"\d{4}(\.\d\d){5}")
_FEATURE: Final = re.compile(r"Bearing(\d)_ch(\d)_(\w+)")
# The owner's archive names the third test's folder 4th_test/txt; some unpackers rename it.
_FOLDERS: Final = {
    1: ("1st_test",),
    2: ("2nd_test",),
    3: ("4th_test/txt", "3rd_test/4th_test/txt", "3rd_test/txt", "3rd_test"),
}


def load_ims(
    root: str | os.PathLike[str] | None = None, *, test: int | None = None, fs_hz: float | None = None
) -> RecordSet:
    """Every available raw snapshot, one record per bearing and accelerometer; unit unknown.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent.
    test : {1, 2, 3}, optional
        Only this test; None = all that are available.
    fs_hz : float or None
        Output sampling rate, Hz; None keeps 20 kHz.

    Returns
    -------
    RecordSet
        `fault` is unknown along the run; column end_fault names the defect found at its end, if any. `time_s` counts
        from the test's first snapshot, by the clock in the file names. `group` and bearing_id are test and bearing;
        further columns test, bearing, accelerometer.

    Raises
    ------
    NotAtHandError
        When no raw snapshot is available; the feature tables are read by `ims_features`.
    TwingapError
        On access, when a snapshot is not in the documented form.
    """
    tests = (_known(test),) if test is not None else tuple(_FOLDERS)
    folder, facts = data_root(root), manifest_of("ims")
    conditions: list[Condition] = []
    loads: list[partial[Array]] = []
    snapshot = Latest(columns)  # the columns of one snapshot are read one after the other
    for number in tests:
        rows = [row for row in facts.recordings if row["test"] == number]
        snapshots = _snapshots(folder / "ims", number)
        for path in snapshots:
            elapsed_s = (_clock(path.name) - _clock(snapshots[0].name)).total_seconds()
            for row in rows:
                conditions.append(_condition(row, path.name, elapsed_s, two_axes=len(rows) > 4))
                loads.append(partial(_column, snapshot, path, len(rows), row["column"]))
    if not conditions:
        there = any((folder / "ims").glob("set*_features.csv"))
        raise not_at_hand(facts, folder, "feature tables only, no raw snapshot" if there else "no raw snapshot")
    bearing = BEARINGS[facts.bearing or "ZA-2115"]
    records = RecordSet("ims", facts.unit, bearing, conditions, Each(tuple(loads)))
    return resampled(records, fs_hz)


def ims_features(root: str | os.PathLike[str] | None = None, *, test: int = 2) -> pd.DataFrame:
    """Features per snapshot, bearing and channel, computed by a third party.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent.
    test : {1, 2, 3}
        Test 3 has time features only.

    Returns
    -------
    pandas.DataFrame
        One row per snapshot, bearing and channel: test, bearing, accelerometer, bearing_id, filename, time_s,
        speed_rpm, load_n, end_fault, then rms, mean, std, max, kurt (excess), skew and, where the second table is
        present, its columns. The author does not document the definitions of the spectral ones: check before use.

    Raises
    ------
    NotAtHandError
        When no table of the test is available.
    TwingapError
        When the second table is present without the first, or a table is not in the documented form.
    """
    folder, facts = data_root(root), manifest_of("ims")
    path = folder / "ims" / f"set{_known(test)}_time_features.csv"
    more = folder / "ims" / f"set{test}_shape_spectral_features.csv"
    if not path.is_file():
        error = TwingapError if more.is_file() else NotAtHandError  # a partial set is an error, not an absent set
        raise error("does not exist", where=path, mend="compute features from the raw snapshots instead")
    wide = _table(path)
    for column in ("file_index", "filename"):
        if column not in wide:
            raise TwingapError(f"column {column!r} is missing", where=path, mend="verify the data set")
    try:
        if more.is_file():
            wide = wide.merge(_table(more), on="file_index", how="left", validate="one_to_one")
        clock = pd.to_datetime(wide["filename"].astype(str), format="%Y.%m.%d.%H.%M.%S")
    except (ValueError, KeyError) as error:
        raise TwingapError(f"rows cannot be told apart: {error}", where=path, mend="verify the data set") from error
    time_s = (clock - clock.iloc[0]).dt.total_seconds()
    parts = []
    for row in (row for row in facts.recordings if row["test"] == test):
        own = {
            column: match[3]
            for column in wide.columns
            if (match := _FEATURE.fullmatch(column))
            and (int(match[1]), int(match[2])) == (row["bearing"], row["accelerometer"])
        }
        part = wide[list(own)].rename(columns=own)
        head = {key: row.get(key) for key in ("test", "bearing", "accelerometer", "bearing_id")}
        tail = {key: row.get(key) for key in ("speed_rpm", "load_n", "end_fault")}
        lead = pd.DataFrame({**head, "filename": wide["filename"], "time_s": time_s, **tail}, index=wide.index)
        parts.append(pd.concat([lead, part], axis=1))
    tidy = pd.concat(parts, ignore_index=True)
    return tidy.sort_values(["time_s", "bearing", "accelerometer"], ignore_index=True, kind="stable")


def _column(snapshot: Latest[Array], path: Path, n_columns: int, column: int) -> Array:
    samples: Array = snapshot(path, n_columns)[column].copy()
    return samples


def _known(test: int) -> int:
    if test not in _FOLDERS:
        raise TwingapError(f"test = {test!r}", mend="use 1, 2 or 3")
    return test


def _table(path: Path) -> pd.DataFrame:
    try:
        return pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise TwingapError(f"cannot be read as a table: {error}", where=path, mend="verify the data set") from error


def _snapshots(folder: Path, test: int) -> list[Path]:
    for name in _FOLDERS[test]:
        place = folder / name
        if place.is_dir():
            found = sorted(p for p in place.iterdir() if _SNAPSHOT.fullmatch(p.name))
            if found:
                return found
    return []


def _clock(name: str) -> datetime:
    return datetime.strptime(name, "%Y.%m.%d.%H.%M.%S")


def _condition(row: Mapping[str, Any], snapshot: str, elapsed_s: float, *, two_axes: bool) -> Condition:
    name = f"{row['bearing_id']}-{row['accelerometer']}" if two_axes else row["bearing_id"]
    return Condition(
        name=f"{name}_{snapshot}",
        speed_rpm=float(row["speed_rpm"]),
        fs_hz=float(row["fs_hz"]),
        n_samples=N_SAMPLES,
        load_n=float(row["load_n"]),
        time_s=elapsed_s,
        group=row["bearing_id"],
        extra={key: row.get(key) for key in ("bearing_id", "test", "bearing", "accelerometer", "end_fault")},
    )
