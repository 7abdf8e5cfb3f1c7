"""Vectors in MATLAB files: found by name, read one at a time, refused in one clear line."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import scipy.io

from twingap.errors import TwingapError
from twingap.records import Array

Shapes = dict[str, tuple[int, ...]]


def shapes(path: str | os.PathLike[str]) -> Shapes:
    """Names and shapes of the arrays in a .mat file, without their values.

    Raises
    ------
    TwingapError
        When the file is missing, cut short or no MATLAB file.
    """
    return {name: tuple(shape) for name, shape, _ in _reading(path, lambda: scipy.io.whosmat(os.fspath(path)))}


def vector(path: str | os.PathLike[str], name: str) -> Array:
    """One array of a .mat file as a flat float64 vector [samples].

    Raises
    ------
    TwingapError
        When the file cannot be read or has no such array.
    """
    arrays = _reading(path, lambda: scipy.io.loadmat(os.fspath(path), variable_names=[name]))
    if name not in arrays:
        raise TwingapError(
            f"has no array {name!r}", where=path, mend=f"it holds {', '.join(shapes(path)) or 'nothing'}"
        )
    return np.ascontiguousarray(arrays[name], dtype=np.float64).ravel()


def _reading(path: str | os.PathLike[str], read: Any) -> Any:
    """What `read` returns; whatever SciPy raises on a broken file becomes one line."""
    try:
        return read()
    except FileNotFoundError as error:
        raise TwingapError("does not exist", where=path, mend="fetch the data set or check the data root") from error
    except Exception as error:  # SciPy raises zlib, struct, Type, Value, NotImplemented... on broken files
        raise TwingapError(
            f"cannot be read as a MATLAB file: {error}", where=path, mend="verify the data set and fetch this file anew"
        ) from error
