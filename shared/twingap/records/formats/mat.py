""".mat files of MATLAB 4 to 7: a channel per variable, field, cell or column of a matrix.

bearing.gs                field of a struct           c[1]    second cell
Y[1].Data                 field of a struct array     data[1] second column of a matrix
Y/vibration_1             the same, where the elements carry a name (fields Name and Data)

Level 5 files are read here, element by element, so that nested parts are found without loading their values, and so
that damaged files raise an error: SciPy looks up data types without a range check, and a damaged byte ends the process
(https://github.com/scipy/scipy/pull/25349). Format: "MAT-File Format", The MathWorks. Level 4 is read by SciPy,
version 7.3 by `twingap.records.formats.hdf5`.
"""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, Literal, Protocol

import numpy as np

from twingap.errors import TwingapError
from twingap.records.formats import hdf5
from twingap.records.formats.base import (
    MOST_PARTS,
    Contents,
    Entry,
    Format,
    array_entries,
    named_elements,
    row_or_column,
    take,
    truncated,
)

_MATRIX: Final = 14
_COMPRESSED: Final = 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMBERS: Final = range(6, 16)
_LOGICAL, _COMPLEX = 0x200, 0x800
_KINDS: Final = {_OBJECT: "object", _CHAR: "char", _SPARSE: "sparse", 16: "function", 17: "opaque"}
_STORED: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types in which numbers are stored, by their codes."""
_DEEPEST: Final = 16
"""Nesting that is followed; deeper structures are listed as one part."""
_TEXT: Final = 200
"""Longest text that is read, in characters, as the name of an element."""
_CHUNK: Final = 1 << 16


class _Source(Protocol):
    """Bytes that are read in order."""

    def read(self, n: int, /) -> bytes: ...
    def skip(self, n: int, /) -> None: ...


class _Plain:
    """Bytes of a file, from its present position to the end of an element."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.stream = stream

    def read(self, n: int) -> bytes:
        data = self.stream.read(n)
        if len(data) < n:
            raise truncated(n - len(data))
        return data

    def skip(self, n: int) -> None:
        self.stream.seek(n, 1)


class _Inflated:
    """Bytes of a compressed element, decompressed as they are asked for."""

    def __init__(self, stream: IO[bytes], size: int) -> None:
        self.stream, self.left = stream, size
        self.inflate = zlib.decompressobj()

    def _some(self, n: int) -> bytes:
        """At least one byte and at most n."""
        while not self.inflate.eof:
            packed = self.inflate.unconsumed_tail or self._packed()
            if data := self.inflate.decompress(packed, n):
                return data
            if not packed:
                break
        raise truncated(n)

    def _packed(self) -> bytes:
        data = self.stream.read(min(self.left, _CHUNK))
        self.left -= len(data)
        return data

    def read(self, n: int) -> bytes:
        parts = []
        while n > 0:
            parts.append(self._some(min(n, 1 << 24)))
            n -= len(parts[-1])
        return b"".join(parts)

    def skip(self, n: int) -> None:
        while n > 0:
            n -= len(self._some(min(n, _CHUNK)))

    def finish(self) -> None:
        """Read to the end, where the checksum is compared, unless that is far away."""
        for _ in range(16):
            packed = self.inflate.unconsumed_tail or self._packed()
            if self.inflate.eof or not packed:
                return
            self.inflate.decompress(packed, _CHUNK)


@dataclass(frozen=True)
class _Leaf:
    """One array that holds no others; its values are not read yet.

    Parameters
    ----------
    path : str
    shape : tuple of int
    problem : str or None
        Why its values are not samples.
    stored : numpy.dtype or None
        Type of the values in the file; None where they are not read.
    values : bytes or None
        The values, where they lie within the tag.
    source : _Source
        Positioned at the values.
    n_bytes : int
    text : str or None
        Of a short text.
    """

    path: str
    shape: tuple[int, ...]
    problem: str | None
    source: _Source
    stored: np.dtype[Any] | None = None
    values: bytes | None = None
    n_bytes: int = 0
    text: str | None = None

    def load(self) -> Any:
        """The values, in the shape of the array."""
        assert self.stored is not None
        data = self.source.read(self.n_bytes) if self.values is None else self.values
        return np.frombuffer(data, self.stored).reshape(self.shape, order="F")


class _Counted:
    """A source that counts what was read, so that the end of an element can be found whatever was read of it."""

    def __init__(self, source: _Source) -> None:
        self.source, self.at = source, 0

    def read(self, n: int) -> bytes:
        self.at += n
        return self.source.read(n)

    def skip(self, n: int) -> None:
        if n < 0:
            raise TwingapError("is damaged: a part is longer than the array that holds it")
        self.at += n
        self.source.skip(n)


class _Walk:
    """Leaves of one variable, in the order of the file."""

    def __init__(self, source: _Counted, order: Literal["<", ">"]) -> None:
        self.source, self.order, self.seen = source, order, 0

    def tag(self) -> tuple[int, int, bytes | None]:
        """Type and size of the next part; and its bytes where it is stored within the tag (up to 4 bytes)."""
        raw = self.source.read(8)
        kind, size = struct.unpack(self.order + "II", raw)
        if kind >> 16:
            if kind >> 16 > 4:
                raise TwingapError("is damaged: its data are of no known type")
            return kind & 0xFFFF, kind >> 16, raw[4 : 4 + (kind >> 16)]
        return kind, size, None

    def small(self, most: int = 1 << 20) -> bytes:
        """Bytes of a part that describes others."""
        _, size, data = self.tag()
        if data is not None:
            return data
        if size > most:
            raise TwingapError("is damaged: a header of impossible length")
        padded = self.source.read(size + -size % 8)
        return padded[:size]

    def matrix(self, size: int, path: str, depth: int = 0) -> Iterator[_Leaf]:
        """Leaves of the array of `size` bytes at the source's position, which is left at its end."""
        self.seen += 1
        if self.seen > MOST_PARTS:
            raise TwingapError(f"holds more than {MOST_PARTS} nested parts", mend="save the record as a variable")
        end = self.source.at + size
        if size == 0:
            if path:
                yield _Leaf(path, (0, 0), None, self.source, np.dtype("f8"), b"")
            return
        flags = struct.unpack_from(self.order + "I", self.small())[0]
        kind = flags & 0xFF
        if kind == 17:  # objects have a layout of their own
            yield _Leaf(path or "object", (), "holds values of type 'opaque', real numbers expected", self.source)
            self.source.skip(end - self.source.at)
            return
        raw = self.small()
        shape = struct.unpack(f"{self.order}{len(raw) // 4}i", raw[: len(raw) // 4 * 4])
        name = self.small().decode("latin-1")
        path = path or name
        if path:  # one without a name holds MATLAB's own data
            yield from self._content(kind, flags, shape, path, depth)
        self.source.skip(end - self.source.at)

    def _content(self, kind: int, flags: int, shape: tuple[int, ...], path: str, depth: int) -> Iterator[_Leaf]:
        if kind in (_CELL, _STRUCT) and depth >= _DEEPEST:
            yield _Leaf(path, shape, "is nested too deeply", self.source)
        elif kind == _CELL:
            for i in range(self._number(shape)):
                yield from self._nested(f"{path}[{i}]", depth)
        elif kind == _STRUCT:
            yield from self._struct(shape, path, depth)
        elif kind in _NUMBERS:
            yield self._numbers(flags, shape, path)
        elif kind == _CHAR:
            yield self._text(shape, path)
        else:
            what = f"holds values of type {_KINDS.get(kind, str(kind))!r}, real numbers expected"
            yield _Leaf(path, shape, what, self.source)

    def _number(self, shape: tuple[int, ...]) -> int:
        if any(n < 0 for n in shape) or (number := math.prod(shape)) > MOST_PARTS:
            raise TwingapError(f"has more than {MOST_PARTS} nested parts", mend="save the record as a variable")
        return number

    def _nested(self, path: str, depth: int) -> Iterator[_Leaf]:
        kind, size, _ = self.tag()
        if kind != _MATRIX:
            raise TwingapError("is damaged: its data are of no known type")
        yield from self.matrix(size, path, depth + 1)

    def _struct(self, shape: tuple[int, ...], path: str, depth: int) -> Iterator[_Leaf]:
        raw = self.small()
        length = struct.unpack(self.order + "i", raw[:4])[0]
        names = self.small()
        if length < 1:
            raise TwingapError("is damaged: fields without names")
        fields = [names[i : i + length].partition(b"\0")[0].decode("latin-1") for i in range(0, len(names), length)]
        number = self._number(shape)
        for i in range(number):
            for name in fields:
                yield from self._nested(f"{path}.{name}" if number == 1 else f"{path}[{i}].{name}", depth)

    def _numbers(self, flags: int, shape: tuple[int, ...], path: str) -> _Leaf:
        kind, size, data = self.tag()
        problem = None
        if flags & _LOGICAL:
            problem = "holds true/false values, real numbers expected"
        elif flags & _COMPLEX:
            problem = "holds complex numbers, real numbers expected"
        if kind not in _STORED:
            return _Leaf(path, shape, "is damaged: its data are of no known type", self.source)
        stored = np.dtype(self.order + _STORED[kind])
        if any(n < 0 for n in shape) or math.prod(shape) * stored.itemsize != size:
            return _Leaf(path, shape, "is damaged: it holds other data than its shape says", self.source)
        return _Leaf(path, shape, problem, self.source, stored, data, size)

    def _text(self, shape: tuple[int, ...], path: str) -> _Leaf:
        kind, size, data = self.tag()
        text = None
        if size <= 4 * _TEXT:
            raw = self.source.read(size) if data is None else data
            wide = {4: "utf-16", 17: "utf-16", 18: "utf-32"}.get(kind)
            end = "-le" if self.order == "<" else "-be"
            text = raw.decode(wide + end if wide else "utf-8", errors="replace")
        return _Leaf(path, shape, "holds values of type 'char', real numbers expected", self.source, text=text)


def _leaves(path: Path) -> Iterator[_Leaf]:
    """All arrays of a level 5 file that hold no others."""
    with path.open("rb") as stream:
        order: Literal["<", ">"] = "<" if stream.read(128).endswith(b"IM") else ">"
        end = path.stat().st_size
        while len(raw := stream.read(8)) == 8:
            kind, size = struct.unpack(order + "II", raw)
            here = stream.tell()
            if here + size > end:
                raise truncated(here + size - end)
            if kind == _COMPRESSED:
                inflated = _Inflated(stream, size)
                walk = _Walk(_Counted(inflated), order)
                kind, inner, _ = walk.tag()
                if kind == _MATRIX:
                    yield from _variable(walk, inner)
            elif kind == _MATRIX:
                yield from _variable(_Walk(_Counted(_Plain(stream)), order), size)
            else:
                raise TwingapError("is damaged: an element of no known type")
            stream.seek(here + size)


def _variable(walk: _Walk, size: int) -> Iterator[_Leaf]:
    """Leaves of one variable; a lone array is not read to its end."""
    for leaf in walk.matrix(size, ""):
        yield leaf
        if walk.seen == 1:
            return


def _level(path: Path) -> Literal[4, 5, 7]:
    with path.open("rb") as stream:
        start = stream.read(1024)
    if b"\x89HDF\r\n\x1a\n" in start or start.startswith(b"MATLAB 7.3"):
        return 7
    return 5 if start[124:128].endswith((b"IM", b"MI")) else 4


def _names(leaves: list[_Leaf]) -> dict[str, str]:
    """Short names of the elements of struct arrays, by path."""
    texts = {leaf.path: leaf.text for leaf in leaves if leaf.text is not None}
    return named_elements((leaf.path for leaf in leaves if leaf.text is None), texts)


def _inspect(path: Path) -> Contents:
    level = _level(path)
    if level == 7:
        return hdf5.inspect_mat(path)
    if level == 4:
        return _inspect_4(path)
    leaves = list(_leaves(path))
    short = _names(leaves)
    entries: list[Entry] = []
    rows = {}
    for leaf in leaves:
        name = short.get(leaf.path, leaf.path)
        found, those = array_entries(name, leaf.shape, leaf.problem)
        entries += found
        if those is not None and leaf.problem is None:
            rows[name] = those
    return Contents(tuple(entries), keyed=True, rows=rows)


def _inspect_4(path: Path) -> Contents:
    from scipy.io import whosmat

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*byte ordering")  # obsolete byte orders are read wrongly
        variables = whosmat(str(path), appendmat=False)
    entries: list[Entry] = []
    rows = {}
    for name, shape, kind in variables:
        wrong = (
            None
            if kind in ("double", "single") or kind.startswith(("int", "uint"))
            else (f"holds values of type {kind!r}, real numbers expected")
        )
        found, those = array_entries(name, shape, wrong)
        entries += found
        if those is not None:
            rows[name] = those
    return Contents(tuple(entries), keyed=True, rows=rows)


def _load(path: Path, name: str, place: int) -> Any:
    level = _level(path)
    if level == 7:
        return hdf5.load_mat(path, name, place)
    if level == 4:
        return _load_4(path, name)
    wanted = {name}
    part = row_or_column(name)
    if part is not None:
        wanted.add(part[0])
    if "/" in name:
        wanted |= {long for long, short in _names(list(_leaves(path))).items() if short in wanted}
    for leaf in _leaves(path):
        if leaf.path not in wanted:
            continue
        if leaf.problem is not None:
            raise TwingapError(leaf.problem, where=f"{path}, channel {name}")
        array = leaf.load()
        _verify(leaf.source)
        return array if max(array.shape, default=0) == array.size else take(array, name)
    raise KeyError(name)


def _verify(source: _Source) -> None:
    """Read a compressed element to its end, where its checksum is compared."""
    inner = source.source if isinstance(source, _Counted) else source
    if isinstance(inner, _Inflated):
        inner.finish()


def _load_4(path: Path, name: str) -> Any:
    from scipy.io import loadmat

    part = row_or_column(name)
    wanted = part[0] if part is not None else name
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # these concern other variables
        held = loadmat(str(path), appendmat=False, variable_names=[name, wanted])
    return held[name] if name in held else take(held[wanted], name)


MAT = Format(_inspect, _load)
