"""Contents of a sample file as its header describes them, and the two functions that every format has.

A channel is one vector. Formats that hold matrices list a channel per column; rows are read on request:

data        a vector                      data[1]       column 1 of a matrix (from 0)
data[row 1] row 1 of a matrix             1, row 1      the same in .npy files, whose array has no name
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from twingap.errors import TwingapError

MOST_CHANNELS: Final = 64
"""Columns of a matrix beyond which they are not taken for channels; a larger value accepts windows as channels."""
MOST_SAMPLES: Final = 2**28
"""Largest array that is read, in values (2 GiB as float64); a larger value needs more memory."""
MOST_PARTS: Final = 20_000
"""Largest number of nested parts (fields, cells, groups) of a file; a larger value reads damaged files for longer."""
_PART: Final = re.compile(r"(?:(.*)\[)?(row )?(\d{1,9})(?(1)\])")


class Entry(NamedTuple):
    """One array in a file.

    Parameters
    ----------
    name : str
        Key, path, column name, or index where columns have no names.
    n_samples : int
        Number of values; 0 where unknown.
    problem : str or None
        Why it is not a vector of samples; None when it is one.
    mend : str or None
        Remedy for the problem.
    unit : str
        As the file states it; empty = not stated.
    """

    name: str
    n_samples: int
    problem: str | None = None
    mend: str | None = None
    unit: str = ""


@dataclass(frozen=True)
class Contents:
    """Entries of a file.

    Parameters
    ----------
    entries : tuple of Entry
    keyed : bool
        Whether entries are known by key alone, not by index.
    fs_hz : float or None
        Sampling rate that the file itself states.
    rows : Mapping[str, tuple[int, int]]
        Number and length of the rows of each matrix, by its name; "" for the array of a .npy file.
    notes : tuple of str
        How the file was understood.
    """

    entries: tuple[Entry, ...]
    keyed: bool = False
    fs_hz: float | None = None
    rows: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Format:
    """Functions of one file type: inspect (path -> contents) and load (path, name, place of an entry -> values)."""

    inspect: Callable[[Path], Contents]
    load: Callable[[Path, str, int], Any]


def not_real(dtype: np.dtype[Any]) -> str | None:
    """Why values of this type are not samples; None when they are."""
    if dtype.kind in "fiu":
        return None
    names = {"c": "complex numbers", "b": "true/false values", "U": "text", "S": "text", "O": "objects"}
    return f"holds {names.get(dtype.kind, f'values of type {dtype}')}, real numbers expected"


def array_entries(name: str, shape: Iterable[int], problem: str | None) -> tuple[list[Entry], tuple[int, int] | None]:
    """Channels of an array: itself where it is a vector, else its columns; and number and length of its rows.

    Parameters
    ----------
    name : str
        Empty for the array of a .npy file, whose columns are named by their index alone.
    shape : iterable of int
    problem : str or None
        Why its values are not samples.

    Returns
    -------
    entries : list of Entry
        One entry with the problem where the columns are no channels.
    rows : tuple of int or None
        None where the array is no matrix.
    """
    shape = tuple(shape)
    size = math.prod(shape)
    shown = f"{name or '0'}"
    if problem is not None:  # of other types: no candidates for the record
        return [Entry(shown, 0, problem)], None
    if any(n < 0 for n in shape):
        return [Entry(shown, 0, f"has shape {shape}, one vector expected")], None
    if size > MOST_SAMPLES:
        what = f"states {size} values, at most {MOST_SAMPLES} are read"
        return [Entry(shown, size, what, "cut it into shorter records")], None
    if (shape or name) and sum(n != 1 for n in shape) <= 1:  # without a shape: a single number beside arrays
        return [Entry(shown, size)], None
    if len(shape) != 2 or not size:
        return [Entry(shown, size if len(shape) > 1 else 0, f"has shape {shape}, one vector expected")], None
    rows = (shape[0], shape[1])
    row = f"{name}[row 0]" if name else "row 0"
    if shape[1] > shape[0]:
        what = f"has {shape[1]} columns of {shape[0]} samples, a column per channel expected"
        if name:
            what = f"has shape {shape}, one vector expected"
        mend = f'transpose it, so that samples run along the first axis, or name a row as the channel ("{row}")'
        return [Entry(shown, size, what, mend)], rows
    if shape[1] > MOST_CHANNELS:
        what = f"has {shape[1]} columns of {shape[0]} samples, which are windows rather than channels"
        mend = f'name a row as the channel ("{row}"), or write at most {MOST_CHANNELS} columns'
        return [Entry(shown, size, what, mend)], rows
    return [Entry(f"{name}[{i}]" if name else str(i), shape[0]) for i in range(shape[1])], rows


def row_or_column(name: str) -> tuple[str, str, int] | None:
    """Name of the matrix, "row" or "column", and index, of a channel such as `data[1]`; None for other names."""
    found = _PART.fullmatch(name)
    if found is None:
        return None
    return found[1] or "", "row" if found[2] else "column", int(found[3])


def take(array: Any, name: str) -> Any:
    """The row or column of a matrix that a channel's name ends in."""
    part = row_or_column(name)
    if part is None:
        raise KeyError(name)
    return array[part[2]] if part[1] == "row" else array[:, part[2]]


def named_elements(vectors: Iterable[str], texts: Mapping[str, str]) -> dict[str, str]:
    """Short names of the arrays of a struct array whose elements carry a name: `Y[1].Data` -> `Y/vibration_1`.

    Parameters
    ----------
    vectors : iterable of str
        Paths of arrays.
    texts : Mapping[str, str]
        Path -> text, of all short texts.

    Returns
    -------
    dict[str, str]
        Only of arrays whose short name no other has.
    """
    paths = list(vectors)
    labels = {
        path.rpartition(".")[0]: text.strip()
        for path, text in texts.items()
        if path.rpartition(".")[2].lower() in ("name", "label", "channelname") and text.strip()
    }
    short = {}
    for path in paths:
        element, _, last = path.rpartition(".")
        if element in labels and element.endswith("]") and last.lower() in ("data", "values", "value", "signal", "y"):
            short[path] = f"{element.rpartition('[')[0]}/{labels[element]}"
    count = Counter([*short.values(), *paths])
    return {path: name for path, name in short.items() if count[name] == 1}


@contextmanager
def needed_for(suffix: str, package: str) -> Iterator[None]:
    """Explain the import of a package that only some file types need.

    Raises
    ------
    TwingapError
        When it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise TwingapError(
            f"files of type {suffix} need the package {package}", mend='install it: pip install "twingap[formats]"'
        ) from error


def truncated(missing: int) -> TwingapError:
    """Error of a file whose end is missing."""
    return TwingapError(f"is truncated: {missing} bytes are missing", mend="copy or write it again")
