"""Text files with columns of numbers, read in one pass."""

from __future__ import annotations

import os

import numpy as np
import pandas as pd

from twingap.errors import TwingapError
from twingap.records import Array


def columns(path: str | os.PathLike[str], n_columns: int) -> Array:
    """A text file of numbers, without header, as [columns, samples].

    The delimiter (comma, semicolon, tab or blank) is inferred from the first line.

    Parameters
    ----------
    path : path-like
    n_columns : int
        Required number of columns.

    Returns
    -------
    Array [columns, samples]

    Raises
    ------
    TwingapError
        When the file is missing, has another number of columns, or holds a value that is not a number.
    """
    try:
        with open(path, encoding="utf-8-sig", errors="strict") as stream:
            first = stream.readline().strip()
        separator = next((mark for mark in (";", ",", "\t") if mark in first), r"\s+")
        table = pd.read_csv(path, sep=separator, header=None, dtype=np.float64)
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror}", where=path) from error
    except ValueError as error:  # pandas' parser errors and text that is not UTF-8 are ValueErrors
        raise TwingapError(
            f"is not a table of numbers: {error}", where=path, mend="verify the data set and fetch it anew"
        ) from error
    if table.shape[1] != n_columns:
        raise TwingapError(f"has {table.shape[1]} columns, {n_columns} expected", where=path)
    samples = np.ascontiguousarray(table.to_numpy().T)
    if not np.isfinite(samples).all():
        row = int(np.argmin(np.isfinite(samples).all(axis=0)))
        raise TwingapError("holds no number", where=f"{path}, line {row + 1}", mend="verify the data set")
    return samples
