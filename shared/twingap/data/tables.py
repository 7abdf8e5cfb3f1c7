"""Snapshots kept as text: columns of numbers, read in one pass, refused in one clear line."""

from __future__ import annotations

import os

import numpy as np
import pandas as pd

from twingap.errors import TwingapError
from twingap.records import Array


def columns(path: str | os.PathLike[str], n_columns: int, header: tuple[str, ...] | None = None) -> Array:
    """A text file of numbers as [columns, samples].

    Commas, semicolons, tabs and blanks are told apart by the first line.

    Parameters
    ----------
    path : path-like
    n_columns : int
        How many columns it must have.
    header : tuple of str, optional
        Names expected on the first line; None = there is no such line.

    Raises
    ------
    TwingapError
        When the file is missing, has other columns, or holds something that is not a number.
    """
    try:
        with open(path, encoding="utf-8-sig", errors="strict") as stream:
            first = stream.readline().strip()
        separator = next((mark for mark in (";", ",", "\t") if mark in first), r"\s+")
        if header is not None and tuple(name.strip() for name in first.split(separator)) != header:
            raise TwingapError(
                f"begins with {first[:80]!r}", where=path, mend=f"the header {','.join(header)} is expected"
            )
        table = pd.read_csv(path, sep=separator, header=None, skiprows=0 if header is None else 1, dtype=np.float64)
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror}", where=path) from error
    except TwingapError:
        raise
    except ValueError as error:  # pandas' parser errors and text that is not UTF-8 are ValueErrors
        raise TwingapError(
            f"is not a table of numbers: {error}", where=path, mend="verify the data set and fetch it anew"
        ) from error
    if table.shape[1] != n_columns:
        raise TwingapError(f"has {table.shape[1]} columns, {n_columns} expected", where=path)
    return np.ascontiguousarray(table.to_numpy().T)
