"""Selection of records by column values, such as load_hp=2, fault=inner."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from twingap.errors import TwingapError
from twingap.records import RecordSet

_CONDITION = re.compile(r"\s*([^=<>!\s][^=<>!]*?)\s*=\s*(.*?)\s*", re.DOTALL)
_SHOWN = 12


def where(records: RecordSet, conditions: Iterable[str]) -> RecordSet:
    """The records that meet all conditions.

    Parameters
    ----------
    records : RecordSet
    conditions : iterable of str
        Each ``column=value``, or several of them separated by commas. Columns are those of `RecordSet.table`. Numbers
        are compared as numbers (``load_hp=2`` matches 2.0), text literally, with or without quotes; an empty value
        matches empty cells.

    Returns
    -------
    RecordSet

    Raises
    ------
    TwingapError
        For a condition of another form, an unknown column, text for a column of numbers, or when no record is left;
        lists the existing columns or values.
    """
    table = records.table
    kept = np.ones(len(table), dtype=bool)
    parts = [part for condition in conditions for part in condition.split(",")]
    for condition in parts:
        match = _CONDITION.fullmatch(condition)
        if match is None:
            raise TwingapError(f"{condition.strip()!r} is no condition", where="--where", mend="write column=value")
        column, text = match[1], match[2]
        if column not in table:
            raise TwingapError(f"no column {column!r}", where="--where", mend=f"columns: {', '.join(table.columns)}")
        kept &= _holds(table[column], column, _unquoted(text))
        if not kept.any():
            raise TwingapError(
                f"no record of {records.name} has {' and '.join(part.strip() for part in parts)}",
                where="--where",
                mend=f"{column} takes {_values(table[column])}",
            )
    return records.take(int(place) for place in np.flatnonzero(kept))


def _holds(cells: pd.Series[Any], column: str, text: str) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """[records] Whether each cell has this value."""
    empty = cells.isna().to_numpy()
    if text == "":
        return np.asarray(empty)
    given = cells[~empty]
    if len(given) and all(isinstance(value, int | float | np.number) for value in given):
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if math.isnan(number):
            raise TwingapError(
                f"{column} = {text!r}, a number expected", where="--where", mend=f"{column} takes {_values(cells)}"
            )
        return np.asarray(cells.to_numpy(dtype=float, na_value=math.nan) == number)
    return np.asarray([not hole and str(value) == text for value, hole in zip(cells, empty, strict=True)])


def _unquoted(text: str) -> str:
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"" else text


def _values(cells: pd.Series[Any]) -> str:
    """The values of a column, for an error message."""
    distinct = list(dict.fromkeys(cells.dropna()))
    text = ", ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in distinct[:_SHOWN])
    return (text or "empty values only") + (", ..." if len(distinct) > _SHOWN else "")
