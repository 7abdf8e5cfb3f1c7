"""Table of a record set, records.csv: rows of text with their locations, and parsing of cells.

Invalid cells are refused with file, row (numbered as in a spreadsheet: the header is row 1) and column.
"""

from __future__ import annotations

import csv
import functools
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from twingap.bearing import FAULTS
from twingap.errors import TwingapError
from twingap.files import open_text
from twingap.records.model import Condition

COLUMNS: Final = ("record", "file", "channel", "speed_rpm", "fault", "load_n", "time_s", "fs_hz", "group")
"""Columns with a defined meaning; all others are passed on as `Condition.extra`."""

_WHOLE: Final = re.compile(r"[+-]?(0|[1-9]\d*)", re.ASCII)
_NUMBER: Final = re.compile(r"[+-]?((0|[1-9]\d*)(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?inf", re.ASCII)
_DIGITS: Final = 400  # longest text that is parsed as a number; Python limits the conversion of long digit strings
_LARGEST: Final = 1 << 30
"""Largest table that is read, in bytes; its rows take several times as much memory."""
_LONGEST: Final = 1 << 22
"""Longest line that is read as one, in characters."""
_TRUTHS: Final = {"true": True, "false": False, "True": True, "False": False}


@dataclass(frozen=True)
class Row:
    """One row of a table: its text and its location.

    Parameters
    ----------
    path : Path
        File of the table.
    number : int
        Row number as in a spreadsheet, from 1; the header counts.
    cells : Mapping[str, str]
        Column -> text.
    """

    path: Path
    number: int
    cells: Mapping[str, str]

    def where(self, column: str | None = None) -> str:
        """File, row and column, for errors."""
        return f"{self.path}, row {self.number}" + (f", column {column}" if column else "")

    def text(self, column: str, needed: bool = False) -> str | None:
        """Text of a cell without surrounding space; None when empty or absent."""
        text = self.cells.get(column, "").strip()
        if needed and not text:
            raise TwingapError("is empty", where=self.where(column), mend="fill it in")
        return text or None

    def number_in(
        self, column: str, *, needed: bool = False, least: float = -math.inf, positive: bool = False
    ) -> float | None:
        """A finite number of at least `least`, above 0 if `positive`; None when empty or absent."""
        text = self.text(column, needed)
        if text is None:
            return None
        try:
            value = math.nan if "_" in text else float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or value < least or (positive and value <= 0):
            wanted = "a positive number" if positive else "a number" if least == -math.inf else "a number of at least 0"
            raise TwingapError(f"{text!r} found, {wanted} expected", where=self.where(column))
        return value

    def condition(
        self, fs_hz: float | None, n_samples: int, extra: Mapping[str, Any], *, labelled: bool = True
    ) -> Condition:
        """The condition in this row, at the rate of its own or else at `fs_hz`; its fault only if `labelled`."""
        name, speed_rpm = self.text("record", needed=True), self.number_in("speed_rpm", needed=True, positive=True)
        fault = self.text("fault") if labelled else None
        if fault is not None and fault not in FAULTS:
            mend = f"use one of {', '.join(FAULTS)}, or leave it empty when unknown"
            raise TwingapError(f"unknown fault {fault!r}", where=self.where("fault"), mend=mend)
        rate = self.rate(fs_hz)
        assert name is not None and speed_rpm is not None
        return Condition(
            name=name, speed_rpm=speed_rpm, fs_hz=rate, n_samples=n_samples, fault=fault,
            load_n=self.number_in("load_n", least=0), time_s=self.number_in("time_s"), group=self.text("group"),
            extra=extra,
        )  # fmt: skip

    def rate(self, fs_hz: float | None, elsewhere: str = "fs_hz in recordset.toml") -> float:
        """Sampling rate of this row, or else `fs_hz`, Hz, which is given in `elsewhere`."""
        rate = self.number_in("fs_hz", positive=True) or fs_hz
        if rate is None:
            mend = f"add a column fs_hz here, or give one rate for all ({elsewhere})"
            raise TwingapError("no sampling rate is given", where=self.where("fs_hz"), mend=mend)
        return rate


def read_table(path: str | os.PathLike[str], needed: Sequence[str]) -> tuple[Row, ...]:
    """Rows of a comma-separated UTF-8 table with a header, blank rows left out, names in `record` unique.

    Parameters
    ----------
    path : path-like
    needed : sequence of str
        Required columns.

    Raises
    ------
    TwingapError
        Naming file, row and column.
    """
    path = Path(path)
    lines = csv_rows(path)
    if not lines:
        raise TwingapError("is empty", where=path, mend=f"begin it with the columns {', '.join(needed)}")
    header = _header(path, lines[0], needed)
    rows, seen = [], dict[str, int]()
    for number, fields in lines[1:]:
        if len(fields) != len(header):
            mend = "put fields that hold commas in double quotes"
            where = f"{path}, row {number}"
            raise TwingapError(f"has {len(fields)} fields, {len(header)} expected", where=where, mend=mend)
        row = Row(path, number, dict(zip(header, fields, strict=True)))
        name = row.text("record", needed=True)
        assert name is not None
        if name in seen:
            what = f"record {name!r} appears twice, first in row {seen[name]}"
            raise TwingapError(what, where=row.where("record"), mend="rename one of them")
        seen[name] = number
        rows.append(row)
    if not rows:
        raise TwingapError("holds no records", where=path, mend="add a row per record")
    return tuple(rows)


def csv_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Fields of a comma-separated UTF-8 table with the numbers of their rows, blank rows left out.

    Raises
    ------
    TwingapError
        When it cannot be read, or is not such a table.
    """
    try:
        with open_text(path, newline="", most=_LARGEST) as stream:
            lines = iter(functools.partial(stream.readline, _LONGEST), "")
            # strict: a stray quote is an error.
            return [(n, row) for n, row in enumerate(csv.reader(lines, strict=True), 1) if any(map(str.strip, row))]
    except (csv.Error, ValueError) as error:
        raise TwingapError(f"is not a comma-separated table: {error}", where=path) from error


def _header(path: Path, line: tuple[int, list[str]], needed: Sequence[str]) -> list[str]:
    """Column names, checked."""
    header = [name.strip() for name in line[1]]
    where = f"{path}, row {line[0]}"
    for place, name in enumerate(header):
        if not name:
            mend = "name it, or write the table without its index"
            raise TwingapError(f"column {place + 1} has no name", where=where, mend=mend)
        if name in header[:place]:
            raise TwingapError(f"column {name!r} appears twice", where=where, mend="rename or remove one")
    for name in needed:
        if name not in header:
            commas = "separate columns by commas" if len(header) == 1 else f"columns found: {', '.join(header[:20])}"
            raise TwingapError(f"column {name!r} is missing", where=where, mend=f"add it ({commas})")
    return header


def extras(rows: Sequence[Row], known: Sequence[str] = COLUMNS) -> tuple[dict[str, Any], ...]:
    """Values of all columns but the `known`, one dict per row.

    A CSV has no types, so they are inferred from whole columns: integers, else numbers, else true/false, else text;
    numbers with leading zeros are text. Empty = None.
    """
    columns = [column for column in rows[0].cells if column not in known]
    typed = {column: _typed([row.cells[column] for row in rows]) for column in columns}
    return tuple({column: typed[column][i] for column in columns} for i in range(len(rows)))


def _typed(texts: list[str]) -> list[Any]:
    given = [text.strip() for text in texts if text.strip()]
    kinds: tuple[tuple[Any, Any], ...] = (
        (_WHOLE.fullmatch, int),
        (_NUMBER.fullmatch, float),
        (_TRUTHS.__contains__, _TRUTHS.__getitem__),
    )
    for fits, make in kinds:
        if all(len(text) <= _DIGITS and fits(text) for text in given):
            return [make(text.strip()) if text.strip() else None for text in texts]
    return [text or None for text in texts]


def write_table(path: Path, rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> None:
    """Write rows as records.csv; None and absent values as empty cells.

    Raises
    ------
    TwingapError
        For a value that a table cannot hold.
    """
    with path.open("w", encoding="utf-8", newline="") as stream:
        stream.write(",".join(map(_quoted, columns)) + "\n")
        for row in rows:
            cells = (as_text(row.get(column), f"record {row['record']!r}, {column}") for column in columns)
            stream.write(",".join(map(_quoted, cells)) + "\n")


def _quoted(text: str) -> str:
    # csv.writer with line ends \n leaves a lone \r unquoted, which readers take for a line end.
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text


def as_text(value: Any, where: str) -> str:
    """A cell's text, from which `read_table` and `extras` restore the value.

    Raises
    ------
    TwingapError
        For a value that a table cannot hold.
    """
    value = value.item() if isinstance(value, np.generic) else value
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) or (isinstance(value, int) and abs(value) < 10**_DIGITS):
        return repr(value)
    if isinstance(value, str) and len(value) < csv.field_size_limit():
        return value
    shown = f"{type(value).__name__} of such length" if isinstance(value, (int, str)) else repr(value)
    raise TwingapError(f"{shown} does not fit a table", where=where, mend="use text, a number, true or false")
