""".npy and .npz files: NumPy's arrays, never unpickled.

.npy: a vector, or a matrix with a channel per column (`0`, `1`; rows as `row 0`).  .npz: the same by key (`data[1]`).
"""

from __future__ import annotations

import math
import os
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from twingap.errors import TwingapError
from twingap.records.formats.base import (
    Contents,
    Entry,
    Format,
    array_entries,
    not_real,
    row_or_column,
    take,
    truncated,
)


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and dtype of the .npy data at the stream's position, which is left at the first value."""
    pickled = TwingapError(
        "holds pickled objects, which are never loaded", mend="save it as an array of numbers, without objects"
    )
    start = stream.read(1)
    stream.seek(0)
    if start == b"\x80":  # first byte of every pickle
        raise pickled
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    if dtype.hasobject:
        raise pickled
    return shape, dtype


def _inspect_npy(path: Path) -> Contents:
    with path.open("rb") as stream:
        shape, dtype = _header(stream)
        here = stream.tell()
        missing = math.prod(shape) * dtype.itemsize - (stream.seek(0, os.SEEK_END) - here)
    if missing > 0:
        raise truncated(missing)
    entries, rows = array_entries("", shape, not_real(dtype))
    return Contents(tuple(entries), rows={} if rows is None else {"": rows})


def _load_npy(path: Path, name: str, place: int) -> Any:
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    return take(array, name) if array.ndim == 2 and min(array.shape) > 1 else array


def _inspect_npz(path: Path) -> Contents:
    entries: list[Entry] = []
    rows = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.namelist():
            if not member.endswith(".npy"):
                continue
            key = member[:-4]
            with archive.open(member) as stream:
                try:
                    shape, dtype = _header(stream)
                except TwingapError as error:
                    raise TwingapError(f"key {key!r} {error.what}", mend=error.mend) from error
            found, those = array_entries(key, shape, not_real(dtype))
            entries += found
            if those is not None:
                rows[key] = those
    return Contents(tuple(entries), keyed=True, rows=rows)


def _load_npz(path: Path, name: str, place: int) -> Any:
    with np.load(path, allow_pickle=False) as archive:
        if name in archive.files:
            return archive[name]
        part = row_or_column(name)
        return take(archive[part[0] if part else name], name)


NPY = Format(_inspect_npy, _load_npy)
NPZ = Format(_inspect_npz, _load_npz)
