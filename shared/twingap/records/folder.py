"""Record sets on disk: recordset.toml, records.csv and the files of samples.

folder --read_record_set--> RecordSet, samples still on disk
RecordSet --write_record_set--> folder;  Record, Record, ... --write_records--> folder
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Final

import numpy as np

from twingap.bearing import Bearing
from twingap.config import build, read_toml, to_toml
from twingap.errors import TwingapError
from twingap.files import kind_of, replacing_folder, save_npy
from twingap.records.model import UNITS, Condition, Record, RecordSet
from twingap.records.samples import Array, Channel, SampleFile, inspect
from twingap.records.table import COLUMNS, Row, extras, read_table, write_table

_PER_FOLDER: Final = 1000
_RATE: Final = 1e-4
"""Relative difference of two statements of one sampling rate; loggers write intervals with five digits."""


@dataclass(frozen=True)
class Head:
    """Table [recordset] of recordset.toml."""

    name: str | None = None
    fs_hz: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class Description:
    """recordset.toml."""

    recordset: Head
    bearing: Bearing | None = None


@dataclass(frozen=True)
class _OnDisk:
    """Loader of record i; picklable, so that worker processes read for themselves."""

    places: tuple[tuple[str, Channel], ...]

    def __call__(self, index: int) -> Array:
        where, channel = self.places[index]
        try:
            return channel.load()
        except TwingapError as error:
            raise _in_row(where, error) from error


def read_record_set(folder: str | os.PathLike[str], *, labelled: bool = True, turning: bool = False) -> RecordSet:
    """Read a record set; its samples stay on disk until accessed.

    Parameters
    ----------
    folder : path-like
        Holds recordset.toml, records.csv and the samples. Files are named relative to it; absolute paths are refused,
        since a folder that names them cannot be moved ("../" and links may lead to samples that lie elsewhere).
    labelled : bool
        False = column fault is not read, and every fault is unknown.
    turning : bool
        True = rows of a machine at standstill (speed_rpm 0) are left out; False = they are refused.

    Returns
    -------
    RecordSet
        Lengths come from the files' headers. Values are checked on access: NaN, infinite or missing
        samples raise then. ``bearing`` is None when recordset.toml has no such table.

    Raises
    ------
    TwingapError
        Naming file, row, column and reason.
    """
    folder = Path(folder)
    about = read_description(folder)
    rows = read_table(folder / "records.csv", ("record", "file", "speed_rpm"))
    if turning and not (rows := tuple(row for row in rows if row.number_in("speed_rpm") != 0)):
        raise TwingapError("holds no record of a machine that turns", where=folder / "records.csv")
    opened: dict[str, SampleFile] = {}
    conditions, places = [], []
    for row, extra in zip(rows, extras(rows), strict=True):
        rate = row.rate(about.recordset.fs_hz)
        channel = channel_of(folder, row, rate, opened)
        conditions.append(row.condition(rate, channel.n_samples, extra, labelled=labelled))
        places.append((row.where("file"), channel))
    name = about.recordset.name or folder.resolve().name
    return RecordSet(name, about.recordset.unit, about.bearing, conditions, _OnDisk(tuple(places)))


def read_description(folder: str | os.PathLike[str]) -> Description:
    """Content of recordset.toml: the properties that all records of a set share.

    Raises
    ------
    TwingapError
        When there is no such folder, or the file is invalid; names file, key and reason.
    """
    folder = Path(folder)
    if (kind := kind_of(folder)) != "folder":
        what = "no such folder" if kind == "missing" else "is not a folder"
        raise TwingapError(what, where=folder, mend="name the folder that holds recordset.toml and records.csv")
    path = folder / "recordset.toml"
    if not path.exists():
        mend = f"make a record set of other files: twingap import {folder}/* --out SET"
        raise TwingapError("holds no recordset.toml", where=folder, mend=mend)
    about = build(Description, read_toml(path), path)
    if about.recordset.unit not in UNITS:
        mend = 'use "m/s^2", "g" or "" (unknown)'
        raise TwingapError(f"unit = {about.recordset.unit!r}", where=f"{path}: recordset", mend=mend)
    if about.recordset.fs_hz is not None and about.recordset.fs_hz <= 0:
        what = f"fs_hz = {about.recordset.fs_hz!r}, a positive number expected"
        raise TwingapError(what, where=f"{path}: recordset")
    return about


def write_records(
    folder: str | os.PathLike[str],
    name: str,
    unit: str,
    bearing: Bearing | None,
    fs_hz: float | None,
    records: Iterable[Record],
) -> Path:
    """Write records one at a time; the folder appears when all of them are written.

    Samples are written as float64, one .npy file per record and a thousand files per folder, so that a round trip is
    exact, at twice the size of float32.

    Parameters
    ----------
    folder : path-like
        Must be absent or empty.
    name, unit, bearing
        As in `RecordSet`.
    fs_hz : float or None
        Rate stated for all, Hz; records at other rates state their own. None = that of the first record.
    records : iterable of Record
        Names unique. Values of `extra` are text, numbers, true or false, or None; a key that only some records have
        is None in the others. Text is restored as numbers where a whole column looks like numbers.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    TwingapError
        When a record or the folder cannot be written; no partial folder is left.
    """
    if unit not in UNITS:
        raise TwingapError(f"unit = {unit!r}", where=f"record set {name!r}", mend='use "m/s^2", "g" or "" (unknown)')
    with replacing_folder(folder) as temporary:
        rows: list[dict[str, Any]] = []
        names: set[str] = set()
        for record in records:
            condition = record.condition
            _check(record, names)
            names.add(condition.name)
            file = f"samples/{len(rows) // _PER_FOLDER:04d}/{len(rows):06d}.npy"
            if len(rows) % _PER_FOLDER == 0:
                (temporary / file).parent.mkdir(parents=True)
            save_npy(temporary / file, record.samples.astype("<f8"))
            fs_hz = condition.fs_hz if fs_hz is None else fs_hz
            rows.append(_row(condition, file, fs_hz))
        if not rows:
            raise TwingapError("holds no records", where=f"record set {name!r}")
        columns = list(dict.fromkeys(c for row in rows for c in row))
        try:
            write_table(temporary / "records.csv", rows, columns)
            (temporary / "recordset.toml").write_text(_describe(name, unit, bearing, fs_hz), encoding="utf-8")
        except UnicodeEncodeError as error:
            raise TwingapError(f"text that is not Unicode: {error.object!r}", where=f"record set {name!r}") from error
    return Path(folder)


def write_record_set(records: RecordSet, folder: str | os.PathLike[str]) -> Path:
    """Write a record set completely or not at all; see `write_records`.

    Parameters
    ----------
    records : RecordSet
        The most frequent sampling rate is stated once for the set.
    folder : path-like
        Must be absent or empty.

    Returns
    -------
    Path
        The folder.
    """
    (fs_hz, _), *_ = Counter(condition.fs_hz for condition in records.conditions).most_common(1)
    return write_records(folder, records.name, records.unit, records.bearing, fs_hz, records)


def channel_of(folder: Path, row: Row, rate: float, opened: dict[str, SampleFile]) -> Channel:
    """The channel of samples that a row names, and whose file states no other sampling rate.

    Parameters
    ----------
    folder : Path
        Record set.
    row : Row
    rate : float
        Sampling rate of the row, Hz.
    opened : dict[str, SampleFile]
        Files that earlier rows named; extended.

    Raises
    ------
    TwingapError
        Naming the row.
    """
    name = row.text("file", needed=True)
    assert name is not None
    if PurePosixPath(name).is_absolute() or PureWindowsPath(name).is_absolute():
        mend = "name it relative to the folder of the record set"
        raise TwingapError(f"{name!r} is an absolute path", where=row.where("file"), mend=mend)
    try:
        if name not in opened:
            opened[name] = inspect(folder / name)
    except TwingapError as error:
        raise _in_row(row.where("file"), error) from error
    stated = opened[name].fs_hz
    if stated is not None and abs(stated - rate) > max(0.5, _RATE * rate):  # .wav files state whole numbers
        mend = "correct fs_hz there or in recordset.toml"
        what = f"{folder / name} states {stated:g} Hz but the record set {rate:g} Hz"
        raise TwingapError(what, where=row.where("fs_hz"), mend=mend)
    try:
        return opened[name].find(row.text("channel"))
    except TwingapError as error:
        raise _in_row(row.where("channel"), error) from error


def _in_row(where: str, error: TwingapError) -> TwingapError:
    """The same error, prefixed with the row of the table that caused it."""
    return TwingapError(
        error.what if error.where is None else f"{error.where}: {error.what}", where=where, mend=error.mend
    )


def _check(record: Record, names: set[str]) -> None:
    """Refuse a record that could not be read back."""
    condition, where = record.condition, f"record {record.condition.name!r}"
    if condition.name in names:
        raise TwingapError("appears twice", where=where, mend="rename one of them")
    for key, text in (("name", condition.name), ("group", condition.group)):
        if text is not None and (not text or text != text.strip()):
            raise TwingapError(f"{key} {text!r} is empty or has surrounding space", where=where)
    for key in condition.extra:
        if key in COLUMNS or not key or key != key.strip():
            raise TwingapError(f"extra column {key!r} has a name that is taken, empty or has spaces", where=where)
    if not (finite := np.isfinite(record.samples)).all():
        place = int(np.argmin(finite))
        raise TwingapError(f"sample {place} is {record.samples[place]}, finite samples expected", where=where)


def _row(condition: Condition, file: str, fs_hz: float) -> dict[str, Any]:
    return {
        "record": condition.name, "file": file, "speed_rpm": float(condition.speed_rpm), "fault": condition.fault,
        "load_n": condition.load_n, "time_s": condition.time_s,
        "fs_hz": None if condition.fs_hz == fs_hz else float(condition.fs_hz),
        "group": None if condition.group == condition.name else condition.group,
        **condition.extra,
    }  # fmt: skip


def _describe(name: str, unit: str, bearing: Bearing | None, fs_hz: float | None) -> str:
    about: dict[str, Any] = {"recordset": {"name": name, "fs_hz": float(fs_hz or 0), "unit": unit}}
    if bearing is not None:
        about["bearing"] = asdict(bearing)
    return to_toml(about)
