"""Reader of a run as a table of features: CSV with a column time_s, one row per record, one column per feature.

features.csv --numeric columns--> time_s, features --sorted by time--> Run, notes
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.prognosis.health_indicator import Run
from twingap.prognosis.one_run import in_order, listed, side_by_side
from twingap.records.measurable import LEAST, MOST
from twingap.records.table import csv_rows

Array = NDArray[np.float64]

TIME: Final = "time_s"
GROUP: Final = "group"
CONDITIONS: Final = ("record", "file", "channel", "speed_rpm", "load_n", "fs_hz", "fault")
"""Columns of record sets that are no features, even where they are numbers."""


def read_feature_table(path: str | os.PathLike[str], *, group: str | None = None) -> tuple[Run, list[str]]:
    """Features along one run, from a CSV file.

    Parameters
    ----------
    path : path-like
        UTF-8, comma-separated, with a header. Columns of text, those of `CONDITIONS`, and counters (a
        constant step from row to row) are left out.
    group : str, optional
        Group whose rows are the run, where the table contains several.

    Returns
    -------
    run : Run
        Sorted by time_s.
    notes : list of str
        Columns that were left out, and whether rows were sorted.

    Raises
    ------
    TwingapError
        With file, row and column: no time_s, an empty cell or one that is no finite number in a numeric column, every
        time more than once, no features, several groups without a selection.
    """
    path = Path(path)
    header, rows = _rows(path)
    if TIME not in header:
        raise TwingapError(
            f"column {TIME!r} is missing", where=path, mend="add the time of each record, s from the start of the run"
        )
    if group is not None and GROUP not in header:
        raise TwingapError(f"no column {GROUP!r} to find {group!r} in", where=path, mend="leave out --group")
    if GROUP in header and group is not None:
        rows = _of_group(path, rows, header.index(GROUP), group)
    notes: list[str] = []
    time_s = _column(path, rows, header, TIME)
    if time_s is None:
        raise TwingapError("contains no numbers", where=f"{path}, column {TIME}", mend="give times in s")
    if GROUP in header:
        count = _refuse_several(path, rows, header.index(GROUP), time_s)
        if count > 1:
            notes.append(f"{count} groups that follow one another in time: assumed to be recordings of one run")
    features: dict[str, Array] = {}
    text: list[str] = []
    for name in header:
        if name in (TIME, GROUP, *CONDITIONS):
            continue
        column = _column(path, rows, header, name)
        if column is None:
            text.append(name)
        else:
            features[name] = column
    if text:
        notes.append(f"left out, since they contain no numbers: {', '.join(text)}")
    order, sorting = in_order(time_s.tolist(), [f"row {number}" for number, _ in rows], path)
    notes += sorting
    counters = [name for name, x in features.items() if _counts(x[order])]
    for name in counters:
        del features[name]
    if counters:
        notes.append(f"left out, since they only count rows: {', '.join(counters)}")
    if not features:
        raise TwingapError("has no column of features", where=path, mend="add a column of numbers, such as rms")
    values = np.stack(list(features.values()), axis=-1)[order]
    return Run(group or path.stem, time_s[order], tuple(features), values), notes


def _rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Header, and rows with their line numbers from 1."""
    lines = csv_rows(path)
    if not lines:
        raise TwingapError("is empty", where=path, mend=f"begin it with a header: {TIME} and the features' names")
    header = [name.strip() for name in lines[0][1]]
    for name in header:
        if not name or header.count(name) > 1:
            shown = f"column {name!r} appears twice" if name else "a column has no name"
            raise TwingapError(shown, where=f"{path}, row {lines[0][0]}", mend="give each column its own name")
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):  # the separator of spreadsheets in many countries
        mend = "separate columns by commas and write decimal points"
        raise TwingapError("is not a comma-separated table", where=f"{path}, row {lines[0][0]}", mend=mend)
    for number, row in lines[1:]:
        if len(row) != len(header):
            mend = "separate columns by commas, and put fields with commas in double quotes"
            what = f"has {len(row)} fields, {len(header)} expected"
            raise TwingapError(what, where=f"{path}, row {number}", mend=mend)
    if len(lines) == 1:
        raise TwingapError("contains no records", where=path, mend="add a row per record")
    return header, lines[1:]


def _of_group(path: Path, rows: list[tuple[int, list[str]]], column: int, group: str) -> list[tuple[int, list[str]]]:
    """The rows of a group."""
    kept = [(n, row) for n, row in rows if row[column].strip() == group]
    if not kept:
        shown = listed([row[column].strip() for _, row in rows])
        raise TwingapError(f"no group {group!r}", where=path, mend=f"use one of {shown}")
    return kept


def _refuse_several(path: Path, rows: list[tuple[int, list[str]]], column: int, time_s: Array) -> int:
    """Number of groups; raises where they overlap in time and so are several runs."""
    groups = [row[column].strip() or None for _, row in rows]
    if side_by_side(groups, time_s.tolist()):
        shown = listed([group for group in groups if group])
        what = f"contains {len(set(groups) - {None})} runs that overlap in time: {shown}"
        raise TwingapError(what, where=path, mend="select one with --group")
    return len(set(groups) - {None})


def _column(path: Path, rows: list[tuple[int, list[str]]], header: list[str], name: str) -> Array | None:
    """Numbers of a column; None when it contains none."""
    place = header.index(name)
    cells = [row[place].strip() for _, row in rows]
    values = np.array([_number(cell) for cell in cells])
    bad = ~np.isfinite(values)
    if bad.all() and not any(cell.lower() in ("nan", "inf", "-inf") for cell in cells):
        return None
    if bad.any():
        at = int(np.argmax(bad))
        found = repr(cells[at]) if cells[at] else "an empty cell"
        raise TwingapError(
            f"{found} found, a number expected", where=f"{path}, row {rows[at][0]}, column {name}",
            mend="fill it in, or leave out the row or the column",
        )  # fmt: skip
    largest = float(np.abs(values).max())
    if largest and not LEAST < largest < MOST:
        at = int(np.argmax(np.abs(values)))
        size = "large" if largest >= MOST else "small"
        raise TwingapError(
            f"{values[at]:.3g} is too {size} for a measured value", where=f"{path}, row {rows[at][0]}, column {name}",
            mend="check the unit and how the table was written",
        )  # fmt: skip
    return values


def _number(text: str) -> float:
    try:
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan


def _counts(x: Array) -> bool:
    """Whether a column increases by a constant step; it would be the best indicator without any information."""
    steps = np.diff(x)
    return bool(steps.size > 2 and steps[0] != 0 and np.allclose(steps, steps[0], rtol=1e-6, atol=0))
