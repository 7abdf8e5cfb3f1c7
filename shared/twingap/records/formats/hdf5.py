""".h5 and .hdf5 files, and .mat files of MATLAB 7.3, which are HDF5: a channel per data set.

HDF5 paths are written with "/" (`group/data`), MATLAB's with "." and in MATLAB's order of axes (`X.Y[1].Data`). Only
what lies in the file itself is read: soft and external links, external storage and virtual data sets are left out.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from twingap.errors import TwingapError
from twingap.records.formats.base import (
    MOST_PARTS,
    Contents,
    Entry,
    Format,
    array_entries,
    named_elements,
    needed_for,
    not_real,
    row_or_column,
)

_DEEPEST: Final = 16
_TEXT: Final = 200
"""Longest text that is read, in characters, as the name of an element."""
_LARGEST_CHUNK: Final = 2**30
"""Largest compressed block that is read, in bytes, as it is decompressed as a whole."""


class _Leaf(NamedTuple):
    path: str
    data: Any
    problem: str | None
    text: str | None = None


def _class(item: Any) -> str:
    """MATLAB's class of an item; empty where the file is not MATLAB's."""
    value = item.attrs.get("MATLAB_class", b"")
    return value.decode("ascii", errors="replace") if isinstance(value, bytes) else str(value)


class _Walk:
    """All data sets of a file."""

    def __init__(self, file: Any, separator: str) -> None:
        with needed_for(".mat (MATLAB 7.3) and .h5", "h5py"):
            import h5py
        self.h5py = h5py
        self.file, self.separator, self.seen = file, separator, 0
        self.open: set[int] = set()

    def group(self, group: Any, path: str, depth: int = 0) -> Iterator[_Leaf]:
        """Data sets below a group."""
        address = self.h5py.h5o.get_info(group.id).addr
        if address in self.open or depth > _DEEPEST:  # links may go in circles
            return
        self.open.add(address)
        names = [n for n in group if not (depth == 0 and n in ("#refs#", "#subsystem#"))]
        items = {n: group[n] for n in names if isinstance(group.get(n, getlink=True), self.h5py.HardLink)}
        elements = self._struct_array(group, items)
        if elements:
            for i in range(elements):
                for name, item in items.items():
                    yield from self._referred(item, i, f"{path}[{i}]{self.separator}{name}", depth)
        else:
            for name, item in items.items():
                yield from self.item(item, f"{path}{self.separator}{name}" if path else name, depth)
        self.open.discard(address)

    def _struct_array(self, group: Any, items: dict[str, Any]) -> int:
        """Number of elements of MATLAB's struct array, whose fields are data sets of references; 0 for others."""
        if _class(group) != "struct" or not items:
            return 0
        sizes = {item.size if self._refers(item) and not _class(item) else 0 for item in items.values()}
        return sizes.pop() if len(sizes) == 1 else 0

    def _refers(self, item: Any) -> bool:
        return isinstance(item, self.h5py.Dataset) and self.h5py.check_ref_dtype(item.dtype) is self.h5py.Reference

    def _referred(self, references: Any, i: int, path: str, depth: int) -> Iterator[_Leaf]:
        reference = references[np.unravel_index(i, references.shape[::-1])[::-1]]  # MATLAB's order
        if reference:
            yield from self.item(self.file[reference], path, depth + 1)

    def item(self, item: Any, path: str, depth: int) -> Iterator[_Leaf]:
        """Data sets of a group or data set."""
        self.seen += 1
        if self.seen > MOST_PARTS:
            raise TwingapError(f"holds more than {MOST_PARTS} nested parts", mend="save the record as a variable")
        if isinstance(item, self.h5py.Group):
            yield from self.group(item, path, depth + 1)
        elif not isinstance(item, self.h5py.Dataset):
            return
        elif self._refers(item):
            if depth > _DEEPEST or item.size > MOST_PARTS or self._problem(item):
                yield _Leaf(path, item, "is nested too deeply")
                return
            for i in range(item.size):
                yield from self._referred(item, i, f"{path}[{i}]", depth)
        else:
            text = self._text(item)
            problem = "holds text, real numbers expected" if text is not None else self._problem(item)
            yield _Leaf(path, item, problem, text)

    def _problem(self, item: Any) -> str | None:
        """Why a data set is not read."""
        if item.external or item.is_virtual:
            return "lies in another file, which is not read"
        if item.chunks and math.prod(item.chunks) * item.dtype.itemsize > _LARGEST_CHUNK:
            return "is stored in blocks too large to be read"
        if _class(item) == "logical":
            return "holds true/false values, real numbers expected"
        if item.shape is None or "MATLAB_empty" in item.attrs:
            return None
        return None if self._refers(item) else not_real(item.dtype)

    def _text(self, item: Any) -> str | None:
        """Text of a data set; empty where it is long."""
        if _class(item) != "char" and self.h5py.check_string_dtype(item.dtype) is None:
            return None
        if item.shape is None or not 0 < item.size <= _TEXT or self._problem(item) == "lies in another file":
            return ""
        if _class(item) == "char" and item.dtype.kind in "ui":
            return "".join(map(chr, np.ravel(item[()]).tolist()))
        value = np.ravel(item[()])[0]
        return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)


def _open(path: Path) -> Any:
    with needed_for(path.suffix.lower(), "h5py"):
        import h5py
    return h5py.File(path, "r")


def _names(leaves: list[_Leaf]) -> dict[str, str]:
    texts = {leaf.path: leaf.text for leaf in leaves if leaf.text}
    return named_elements((leaf.path for leaf in leaves if leaf.text is None), texts)


def _shape(data: Any, matlab: bool) -> tuple[int, ...]:
    if data.shape is None or "MATLAB_empty" in data.attrs:
        return (0,)
    return tuple(data.shape[::-1] if matlab else data.shape)


def _inspect(path: Path, separator: str, matlab: bool) -> Contents:
    entries: list[Entry] = []
    rows = {}
    with _open(path) as file:
        leaves = list(_Walk(file, separator).group(file, ""))
        short = _names(leaves)
        for leaf in leaves:
            name = short.get(leaf.path, leaf.path)
            found, those = array_entries(name, _shape(leaf.data, matlab), leaf.problem)
            entries += found
            if those is not None and leaf.problem is None:
                rows[name] = those
    return Contents(tuple(entries), keyed=True, rows=rows)


def _load(path: Path, name: str, separator: str, matlab: bool) -> Any:
    part, state = row_or_column(name), path.stat()
    known = _places(path, separator, (state.st_mtime_ns, state.st_size, state.st_ino))
    place, problem = known[name] if name in known or part is None else known[part[0]]
    if problem is not None:
        raise TwingapError(problem, where=f"{path}, channel {name}")
    with _open(path) as file:
        data = file[place]
        if sum(n != 1 for n in data.shape) <= 1:
            return data[()]
        assert part is not None
        along = (part[1] == "row") != matlab
        return data[part[2]] if along else data[:, part[2]]


@functools.lru_cache(maxsize=4)
def _places(path: Path, separator: str, state: object) -> dict[str, tuple[Any, str | None]]:
    """Channel -> where it lies in the file, and why it is not read; kept, as a file may have thousands of channels."""
    with _open(path) as file:
        leaves = list(_Walk(file, separator).group(file, ""))
        short = _names(leaves)
        known: dict[str, tuple[Any, str | None]] = {}
        for leaf in leaves:
            for name in {leaf.path, short.get(leaf.path, leaf.path)}:
                known.setdefault(name, (leaf.data.ref, leaf.problem))
    return known


def inspect_mat(path: Path) -> Contents:
    """Channels of a MATLAB 7.3 file."""
    return _inspect(path, ".", matlab=True)


def load_mat(path: Path, name: str, place: int) -> Any:
    """Samples of a channel of a MATLAB 7.3 file."""
    return _load(path, name, ".", matlab=True)


HDF5 = Format(lambda path: _inspect(path, "/", matlab=False), lambda path, name, place: _load(path, name, "/", False))
