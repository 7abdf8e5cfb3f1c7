"""Text files (.csv, .txt, .tsv, .asc, .dat, .lvm): a table of numbers, with a channel per column, by name or index.

Separators, decimal commas, lines above the table and units are found by `twingap.records.formats.text_layout`; here all
rows are parsed by what was found, by Arrow, and refused with their line where they do not fit.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from twingap.errors import TwingapError
from twingap.records.formats.base import MOST_CHANNELS, MOST_SAMPLES, Contents, Entry, Format, row_or_column
from twingap.records.formats.text_layout import SHOWN, Layout, data_rows, decoded, last_byte, layout

_UNIT: Final = re.compile(r".*[\[(]\s*([^\[\]()]{1,12})\s*[\])]\s*")
_BLOCK: Final = 1 << 24


def _inspect(path: Path) -> Contents:
    found = layout(path)
    rows = data_rows(path, found)
    width = len(found.names)
    if rows > MOST_SAMPLES:
        raise TwingapError(f"has {rows} rows, at most {MOST_SAMPLES} are read", mend="cut it into shorter records")
    if width > MOST_CHANNELS and all(not name or name.isdecimal() for name in found.names):
        what = f"has {width} columns of {rows} samples, which are windows rather than channels"
        mend = f'name a row as the channel ("row 0"), or write at most {MOST_CHANNELS} columns'
        return Contents((Entry("0", rows, what, mend),), False, found.fs_hz, {"": (rows, width)}, found.notes)
    units = [unit or _unit(name) for name, unit in zip(found.names, found.units, strict=True)]
    entries = tuple(
        Entry(name, rows, *_no_values(found, place), unit)
        for place, (name, unit) in enumerate(zip(found.names, units, strict=True))
    )
    return Contents(entries, fs_hz=found.fs_hz, notes=found.notes)


def _no_values(found: Layout, place: int) -> tuple[str | None, str | None]:
    """Why a column is no vector of samples, and the remedy; None where it may be one."""
    if place in found.empty:
        return "all of its cells are empty", "export it again with its values, or take another column"
    if found.text is not None:
        return f"holds no samples: {found.text[:80]!r} found, a number expected", "export it again with its samples"
    return None, None


def _unit(name: str) -> str:
    """Unit in brackets at the end of a column's name."""
    found = _UNIT.fullmatch(name)
    return found[1].strip() if found else ""


def _load(path: Path, name: str, place: int) -> Any:
    found = layout(path)
    part = row_or_column(name)
    if part is not None and part[1] == "row" and name not in found.names:
        return _row(path, found, part[2])
    import pyarrow as pa

    try:
        return _column(path, found, place, pa.float64()).to_numpy()
    except pa.ArrowInvalid:
        pass
    try:
        return _from_text(_column(path, found, place, pa.string()), found.decimal)
    except pa.ArrowInvalid:
        raise _fault(path, found, name, place) from None


def _column(path: Path, found: Layout, place: int, kind: Any) -> Any:
    """One column. Arrow refuses rows with missing or extra fields; pandas would shift or drop values."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    blanks = found.separator == " "
    columns, wanted = [str(i) for i in range(len(found.names))], str(place)
    if found.encoding == "utf-8":
        with path.open("rb") as stream:
            end = last_byte(stream)
        held = pa.memory_map(str(path)).read_buffer().slice(found.start, max(0, end - found.start))
    else:
        held = pa.py_buffer(decoded(path, found.encoding)).slice(found.start)
    source = _SingleBlanks(held) if blanks else pa.BufferReader(held)
    table = arrow_csv.read_csv(
        source,
        read_options=arrow_csv.ReadOptions(use_threads=False, column_names=columns),
        parse_options=arrow_csv.ParseOptions(delimiter=found.separator),
        convert_options=arrow_csv.ConvertOptions(
            include_columns=[wanted], column_types={wanted: kind}, null_values=[], check_utf8=False,
            decimal_point=found.decimal,
        ),
    )  # fmt: skip
    return table.column(0)


class _SingleBlanks(io.RawIOBase):
    """Lines with one blank between fields, from lines with any number of blanks and tabs."""

    def __init__(self, held: Any) -> None:
        self.lines = self._squeezed(memoryview(held))
        self.ready = b""

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        while not self.ready or size < 0:
            block = next(self.lines, None)
            if block is None:
                break
            self.ready += block
        size = len(self.ready) if size < 0 else size
        block, self.ready = self.ready[:size], self.ready[size:]
        return block

    @staticmethod
    def _squeezed(data: memoryview) -> Iterator[bytes]:
        at = 0
        while at < len(data):
            raw = bytes(data[at : at + _BLOCK])
            end = max(raw.rfind(b"\n"), raw.rfind(b"\r")) + 1
            if at + len(raw) < len(data) and end:
                raw = raw[:end]
            at += len(raw)
            x = np.frombuffer(raw, np.uint8)
            blank, ends = (x == 32) | (x == 9), (x == 10) | (x == 13)
            keep = ~blank
            keep[:-1] |= ~(blank[1:] | ends[1:])  # the last blank of each run, unless it ends the line
            x, blank, ends = x[keep], blank[keep], ends[keep]
            keep = ~blank
            keep[1:] |= ~ends[:-1]  # not at the beginning of a line
            x = x[keep]
            x[(x == 9)] = 32
            yield x.tobytes()


def _from_text(column: Any, decimal: str) -> Any:
    """Numbers that are written in ways that Arrow does not read: with a plus sign, in quotes."""
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pc.utf8_trim_whitespace(column)
    text = pc.utf8_trim_whitespace(pc.utf8_trim(text, '"'))
    if decimal == ",":
        if pc.any(pc.match_substring(text, ".")).as_py():
            raise pa.ArrowInvalid("decimal points between decimal commas")
        text = pc.replace_substring(text, ",", ".")
    return pc.cast(pc.replace_substring_regex(text, r"^\+([\d.])", r"\1"), pa.float64()).to_numpy()


def _lines(path: Path, found: Layout) -> Iterator[tuple[int, str]]:
    """Number and text of the lines of the table that are not empty."""
    encoding = "utf-8-sig" if found.encoding == "utf-8" else found.encoding
    with path.open(encoding=encoding, errors="replace") as stream:
        for number, line in enumerate(stream, 1):
            if number > found.skipped and line.strip():
                yield number, line.rstrip("\n")


def _row(path: Path, found: Layout, row: int) -> Any:
    """The numbers of one row."""
    for i, (number, line) in enumerate(_lines(path, found)):
        if i == row:
            values = [found.number(cell) for cell in found.cells(line)]
            if None in values or len(values) != len(found.names):
                raise TwingapError(f"is no row of {len(found.names)} numbers", where=f"{path}, line {number}")
            return np.array(values, dtype=np.float64)
    raise IndexError(row)


def _fault(path: Path, found: Layout, name: str, place: int) -> TwingapError:
    """Error that names the invalid line."""
    width = len(found.names)
    for number, line in _lines(path, found):
        cells, where = found.cells(line), f"{path}, line {number}"
        if len(cells) != width:
            mark = "points" if found.decimal == "." else "commas"
            mend = f"separate fields by {SHOWN[found.separator]} and write decimal {mark}"
            return TwingapError(f"has {len(cells)} fields, {width} expected", where=where, mend=mend)
        if found.number(text := cells[place]) is None:
            what = f"{text!r} found, a number expected" if text else "is empty"
            return TwingapError(what, where=f"{where}, column {name}")
    return TwingapError("is not a table of numbers", where=path)


TEXT = Format(_inspect, _load)
