"""Conditions to simulate, from a record set or from a plain table.

RECORDSET folder  --lengths and rates of its records--> conditions, bearing, unit
CSV               --n_samples or duration_s, fs_hz----> conditions, no bearing, no unit

Used by `twingap simulate TWIN.toml --records RECORDSET_OR_CSV`.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Final, NamedTuple

from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.files import kind_of
from twingap.records.folder import read_record_set
from twingap.records.model import Condition
from twingap.records.table import COLUMNS, Row, extras, read_table

_MOST_SAMPLES: Final = 5 * 10**7
"""Largest length of one simulated record in samples, as it is held in memory; a larger limit needs more memory."""


class Conditions(NamedTuple):
    """Conditions of records to simulate, with bearing and unit.

    Parameters
    ----------
    conditions : tuple of Condition
    bearing : Bearing or None
        None = unknown, as in a CSV.
    unit : {"m/s^2", "g", ""} or None
        Unit of the record set; None = not stated, as in a CSV.
    """

    conditions: tuple[Condition, ...]
    bearing: Bearing | None = None
    unit: str | None = None


def read_conditions(
    path: str | os.PathLike[str], *, fs_hz: float | None = None, duration_s: float | None = None
) -> Conditions:
    """Conditions of records to simulate, and bearing and unit where known.

    Parameters
    ----------
    path : path-like
        A record set (its folder, or the records.csv or recordset.toml in it), or a CSV with the columns of
        records.csv: `record` and `speed_rpm`, optionally `fault`, `load_n`, `time_s`, `fs_hz`, `group`, `n_samples` or
        `duration_s`, and any others, which are passed on. Columns `file` and `channel` do not apply to records that are
        still to be simulated and are left out.
    fs_hz : float, optional
        Sampling rate of rows without one, Hz. Refused with a record set, whose records have their own.
    duration_s : float, optional
        Length of rows without one, s; rounded to whole samples. Refused with a record set.

    Returns
    -------
    Conditions

    Raises
    ------
    TwingapError
        Naming file, row, column and reason, or the invalid option.
    """
    path = Path(path)
    options = {"--fs-hz": fs_hz, "--duration-s": duration_s}
    given = {name: value for name, value in options.items() if value is not None}
    for name, value in given.items():
        if not math.isfinite(value) or value <= 0:
            raise TwingapError(f"{value:g} found, a positive number expected", where=name)
    kind = kind_of(path)
    inside = path.name in ("records.csv", "recordset.toml") and kind_of(path.parent / "recordset.toml") == "file"
    if kind == "folder" or inside:
        records = _of_set(path.parent if inside else path)
        if given:
            what = f"the records of {path} have rates and lengths of their own"
            mend = "leave this out, or name a table of conditions (a copy of records.csv elsewhere)"
            raise TwingapError(what, where=" and ".join(given), mend=mend)
        return records
    if kind == "missing":
        raise TwingapError("no such file or folder", where=path, mend="name a record set or a CSV of conditions")
    if path.suffix.lower() != ".csv" or kind != "file":
        raise TwingapError(
            "is neither a record set nor a CSV", where=path, mend="name a record set's folder or a .csv file"
        )
    rows = read_table(path, ("record", "speed_rpm"))
    rest = extras(rows, (*COLUMNS, "n_samples", "duration_s"))
    conditions = []
    for row, extra in zip(rows, rest, strict=True):
        rate = row.rate(fs_hz, "--fs-hz")
        conditions.append(row.condition(rate, _length(row, rate, duration_s), extra))
    return Conditions(tuple(conditions))


def _of_set(folder: Path) -> Conditions:
    records = read_record_set(folder)
    return Conditions(records.conditions, records.bearing, records.unit)


def _length(row: Row, rate: float, duration_s: float | None) -> int:
    """Length in samples of the record that a row describes."""
    n_samples = row.number_in("n_samples", positive=True)
    seconds = row.number_in("duration_s", positive=True)
    if n_samples is not None:
        if n_samples != int(n_samples):
            raise TwingapError(f"{n_samples:g} found, a whole number expected", where=row.where("n_samples"))
        if seconds is not None and round(seconds * rate) != n_samples:
            what = f"{seconds:g} s at {rate:g} Hz are not the {n_samples:g} samples of column n_samples"
            raise TwingapError(what, where=row.where("duration_s"), mend="give one of the two")
        column = "n_samples"
    else:
        seconds, column = (duration_s, "--duration-s") if seconds is None else (seconds, "duration_s")
        if seconds is None:
            mend = "add a column n_samples or duration_s, or give one length for all (--duration-s)"
            raise TwingapError("no length is given", where=row.where(), mend=mend)
        n_samples = seconds * rate
    if not 0.5 <= n_samples <= _MOST_SAMPLES:
        what = f"{n_samples:.10g} samples, 1 to {_MOST_SAMPLES} expected"
        if column == "--duration-s":
            raise TwingapError(f"{seconds:g} s at {rate:g} Hz are {what}", where=column, mend="check the unit")
        raise TwingapError(what, where=row.where(column), mend="check the unit")
    return max(1, round(n_samples))
