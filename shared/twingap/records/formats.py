"""The six formats of sample files, each with two functions: inspection of a file, and loading of one vector.

No file is ever unpickled. Parsers may raise anything on damaged files; `twingap.records.samples` converts the errors.
"""

from __future__ import annotations

import csv
import math
import os
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import IO, Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError


class Entry(NamedTuple):
    """One array in a file, as described by its header.

    Parameters
    ----------
    name : str
        Key, column name, or index where columns have no names.
    n_samples : int
    problem : str or None
        Why it is not a vector of samples; None when it is one.
    """

    name: str
    n_samples: int
    problem: str | None = None


class Contents(NamedTuple):
    """Entries of a file.

    Parameters
    ----------
    entries : tuple of Entry
    keyed : bool
        Whether entries are known by key alone, not by index.
    fs_hz : float or None
        Sampling rate that the file itself states.
    """

    entries: tuple[Entry, ...]
    keyed: bool = False
    fs_hz: float | None = None


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


def _length(shape: Iterable[int]) -> tuple[int, str | None]:
    """Number of samples in an array of this shape, and why it is not a vector."""
    shape = tuple(shape)
    if not shape or any(n < 0 for n in shape) or sum(n != 1 for n in shape) > 1:
        return 0, f"has shape {shape}, one vector expected"
    return math.prod(shape), None


# --- .npy and .npz -------------------------------------------------------------------------------------------------


def _npy_header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
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


def _has_columns(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and min(shape) > 1


def _inspect_npy(path: Path) -> Contents:
    with path.open("rb") as stream:
        shape, dtype = _npy_header(stream)
        here = stream.tell()
        missing = math.prod(shape) * dtype.itemsize - (stream.seek(0, os.SEEK_END) - here)
    if missing > 0:
        raise TwingapError(f"is truncated: {missing} bytes are missing", mend="copy or write it again")
    problem = not_real(dtype)
    if _has_columns(shape):
        if shape[1] > shape[0]:
            raise TwingapError(
                f"has {shape[1]} columns of {shape[0]} samples, a column per channel expected",
                mend="transpose it, so that samples run along the first axis",
            )
        return Contents(tuple(Entry(str(i), shape[0], problem) for i in range(shape[1])))
    length, odd = _length(shape)
    return Contents((Entry("0", length, problem or odd),))


def _load_npy(path: Path, name: str, place: int) -> Any:
    with path.open("rb") as stream:
        shape, _ = _npy_header(stream)
    if _has_columns(shape):
        return np.load(path, mmap_mode="r", allow_pickle=False)[:, place]
    return np.load(path, allow_pickle=False)


def _inspect_npz(path: Path) -> Contents:
    entries = []
    with zipfile.ZipFile(path) as archive:
        for member in archive.namelist():
            if not member.endswith(".npy"):
                continue
            with archive.open(member) as stream:
                try:
                    shape, dtype = _npy_header(stream)
                except TwingapError as error:
                    raise TwingapError(f"key {member[:-4]!r} {error.what}", mend=error.mend) from error
            length, odd = _length(shape)
            entries.append(Entry(member[:-4], length, not_real(dtype) or odd))
    return Contents(tuple(entries), keyed=True)


def _load_npz(path: Path, name: str, place: int) -> Any:
    with np.load(path, allow_pickle=False) as archive:
        return archive[name]


# --- .mat ----------------------------------------------------------------------------------------------------------

_MAT_NUMBERS: Final = ("double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")


def _inspect_mat(path: Path) -> Contents:
    from scipy.io import whosmat

    with path.open("rb") as stream:
        start = stream.read(1024)
    if b"\x89HDF\r\n\x1a\n" in start or start.startswith(b"MATLAB 7.3"):
        mend = 'save it again in MATLAB with  save(name, "-v7")'
        raise TwingapError("is a MATLAB 7.3 file (HDF5), which is not read", mend=mend)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*byte ordering")  # obsolete byte orders are read wrongly
        variables = whosmat(str(path), appendmat=False)
    entries = []
    for name, shape, kind in variables:
        length, odd = _length(shape)
        wrong = None if kind in _MAT_NUMBERS else f"holds values of type {kind!r}, real numbers expected"
        entries.append(Entry(name, length, wrong or odd))
    return Contents(tuple(entries), keyed=True)


def _load_mat(path: Path, name: str, place: int) -> Any:
    from scipy.io import loadmat

    _check_mat(path, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # these concern other variables
        return loadmat(str(path), appendmat=False, variable_names=[name])[name]


def _check_mat(path: Path, name: str) -> None:
    """Refuse a damaged file that would crash SciPy.

    SciPy 1.17 looks up the data type of a numeric array in a table without a range check; a damaged byte there causes
    a segmentation fault. The tags up to that one are therefore checked here first (MAT-file format, level 5).
    Known upstream: https://github.com/scipy/scipy/pull/25349.
    """
    with path.open("rb") as stream:
        head = stream.read(128)
        if not head[124:128].endswith((b"IM", b"MI")):
            return  # level 4 has no such table
        order: Literal["<", ">"] = "<" if head.endswith(b"IM") else ">"
        while len(tag := stream.read(8)) == 8:
            kind, size = struct.unpack(order + "II", tag)
            here = stream.tell()
            start = stream.read(min(size, 4096))
            if kind == 15:  # compressed
                start = zlib.decompressobj().decompress(start, 4096)[8:]
            problem = _mat_problem(start, order, name.encode("latin-1", errors="replace"))
            if problem is not None:
                raise TwingapError(problem, where=f"{path}, channel {name}")
            stream.seek(here + size)


def _mat_problem(element: bytes, order: Literal["<", ">"], name: bytes) -> str | None:
    """Why SciPy must not load this variable, if it has this name and holds numbers; None when it may.

    Its parts, each after a tag: flags, dimensions, name, numbers (twice where complex).
    """
    flags = struct.unpack_from(order + "I", element, 8)[0] if len(element) >= 16 else 0
    if not 6 <= flags & 0xFF <= 15:
        return None  # cells, structures, objects, text, sparse: never loaded
    at = 16
    for part in ("dimensions", "name", "numbers"):
        if len(element) < at + 8:
            break
        kind, size = struct.unpack_from(order + "II", element, at)
        small = kind >> 16  # up to 4 bytes are stored within the tag itself
        text = element[at + 4 : at + 4 + small] if small else element[at + 8 : at + 8 + size]
        if part == "name" and text != name:
            return None
        if part == "numbers" and (kind & 0xFFFF if small else kind) in _MAT_DATA_TYPES:
            return "holds complex numbers, real numbers expected" if flags & 0x800 else None
        at += 8 if small else 8 + (size + 7) // 8 * 8
    return "is damaged: its data are of no known type"


_MAT_DATA_TYPES: Final = (1, 2, 3, 4, 5, 6, 7, 9, 12, 13)


# --- .csv ----------------------------------------------------------------------------------------------------------


_LOOK: Final = 1000
"""Rows that are inspected where a first row of numbers may be column names; more are slower and safer."""
_NO_NAME: Final = re.compile(
    r"[+\-\u2212\u2013]?\s*[.,]?\d|[+-](nan|inf)|(n/?a|#n/a|null|none|nan\(.*)$", re.IGNORECASE
)
"""Beginnings of text that is a malformed number (a decimal comma, a typographic minus sign, a date), or of a missing
value."""


def _csv_layout(path: Path) -> tuple[list[str], int, int]:
    """Column names (indices where there is no header row), lines before the data, rows of data."""
    # utf-8-sig: spreadsheets write a byte-order mark.
    with path.open(encoding="utf-8-sig") as stream:
        first, skipped = "", 0
        for line in stream:
            if line != "\n":
                first = line
                break
            skipped += 1
        filled = (line for line in stream if line != "\n")
        below = list(islice(filled, _LOOK))
        rows = int(first != "") + len(below) + sum(1 for _ in filled)
    cells = _csv_cells(first)
    try:
        named = _names_columns(cells, below)
    except TwingapError as error:
        raise TwingapError(error.what, where=f"{path}, line {skipped + 1}", mend=error.mend) from error
    if named:
        return cells, skipped + 1, rows - 1
    return [str(i) for i in range(len(cells))], skipped, rows


def _csv_cells(line: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line]), [])]


def _names_columns(cells: list[str], below: list[str]) -> bool:
    """Whether the first row of a CSV is a header, judged by it and the lines below; ambiguous files are refused.

    pandas names unnamed columns 0, 1, 2, ..., and then writes every sample with a decimal point.
    """
    filled = [cell for cell in cells if cell]
    texts = [cell for cell in filled if not _is_number(cell)]
    numbers = [cell for cell in filled if _is_number(cell)]
    second = _csv_cells(below[0]) if below else []
    counted = numbers == [str(i) for i in range(len(numbers))]
    if texts:
        if cells[0].startswith("# "):  # a header written by NumPy
            return True
        for text in texts:
            if _NO_NAME.match(text) or not any(c.isalpha() for c in text):
                raise TwingapError(
                    f"{text[:80]!r} is neither a number nor the name of a column",
                    mend="separate fields by commas and write decimal points, or put a row of column names first",
                )
        if numbers and not (counted and second and all(map(_is_number, second))):
            raise TwingapError(
                f"mixes numbers ({numbers[0][:80]!r}) and text ({texts[0][:80]!r})",
                mend="put a row of column names first, none of them a number",
            )
        return True
    if filled and not cells[0] and second and second[0]:  # the empty header of an index column
        if counted:
            return True
    elif not counted or not 0 < len(filled) == len(cells):
        return False
    elif len(cells) == 1:
        if not _all_pointed(below):
            return False
    elif _all_pointed(below) and not _counts_on(below):
        return True
    raise TwingapError(
        f"{','.join(cells)[:80]!r} may be the names of columns or samples",
        mend="put a row of names first that are no numbers, or write all samples with decimal points (0.0)",
    )


def _all_pointed(below: list[str]) -> bool:
    """Whether samples are present and none is written as a whole number."""
    rows = map(_csv_cells, below)
    return bool(below) and not any(cell.lstrip("+-").isdecimal() for row in rows for cell in row)


def _counts_on(below: list[str]) -> bool:
    """Whether the first column continues as a time axis that starts at 0 in the row above."""
    try:
        one, two = (float(_csv_cells(line)[0]) for line in below[:2])
    except (ValueError, IndexError):
        return False
    return one > 0 and math.isclose(two, 2 * one, rel_tol=1e-3)


def _inspect_csv(path: Path) -> Contents:
    names, _, rows = _csv_layout(path)
    return Contents(tuple(Entry(name, rows) for name in names))


def _load_csv(path: Path, name: str, place: int) -> Any:
    # Arrow refuses rows with missing or extra fields, as decimal commas cause them; pandas would shift or drop values.
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    names, skipped, _ = _csv_layout(path)
    columns, wanted = [str(i) for i in range(len(names))], str(place)
    try:
        table = arrow_csv.read_csv(
            path,
            read_options=arrow_csv.ReadOptions(use_threads=False, column_names=columns, skip_rows=skipped),
            convert_options=arrow_csv.ConvertOptions(
                include_columns=[wanted], column_types={wanted: pa.float64()}, null_values=[], check_utf8=False
            ),
        )
    except pa.ArrowInvalid:
        raise _csv_fault(path, name, place, skipped, len(names)) from None
    return table.column(0).to_numpy()


def _csv_fault(path: Path, name: str, place: int, skipped: int, width: int) -> TwingapError:
    """Error that names the invalid line."""
    with path.open(encoding="utf-8-sig", newline="") as stream:
        rows = csv.reader(stream)
        for row in rows:
            where = f"{path}, line {rows.line_num}"
            if not row or rows.line_num <= skipped:
                continue
            if len(row) != width:
                mend = "separate fields by commas and write decimal points"
                return TwingapError(f"has {len(row)} fields, {width} expected", where=where, mend=mend)
            if not _is_number(text := row[place]):
                what = f"{text!r} found, a number expected" if text else "is empty"
                return TwingapError(what, where=f"{where}, column {name}")
    return TwingapError("is not a table of numbers", where=path)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text  # Python accepts underscores as digit separators


# --- .parquet ------------------------------------------------------------------------------------------------------


def _inspect_parquet(path: Path) -> Contents:
    import pyarrow as pa
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        rows, schema = file.metadata.num_rows, file.schema_arrow
    entries = []
    for field in schema:
        real = pa.types.is_floating(field.type) or pa.types.is_integer(field.type)
        problem = None if real else f"holds values of type {field.type}, real numbers expected"
        entries.append(Entry(field.name, rows, problem))
    return Contents(tuple(entries))


def _load_parquet(path: Path, name: str, place: int) -> Any:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        if file.schema_arrow.names.count(name) > 1:
            raise TwingapError(f"has several columns {name!r}", where=path, mend="rename them")
        column = file.read(columns=[name], use_threads=False).column(name)
    if column.null_count:
        gap = column.is_null().index(True).as_py()
        where = f"{path}, channel {name}"
        raise TwingapError(f"sample {gap} is missing", where=where, mend="mend it or leave the record out")
    return column.to_numpy()


# --- .wav ----------------------------------------------------------------------------------------------------------


def _read_wav(path: Path) -> tuple[int, NDArray[Any]]:
    from scipy.io import wavfile

    _check_wav(path)
    with warnings.catch_warnings():
        # Recorders add chunks of their own, which are irrelevant here.
        warnings.simplefilter("ignore", wavfile.WavFileWarning)
        try:
            return wavfile.read(path, mmap=True)
        except ValueError:
            return wavfile.read(path)  # 24-bit samples cannot be mapped


def _check_wav(path: Path) -> None:
    """Refuse a file with missing samples, or whose header does not state their number.

    SciPy reads the samples that it finds, and none where a recorder left the sizes at 0.
    """
    with path.open("rb") as stream:
        head = stream.read(12)
        if head[:4] not in (b"RIFF", b"RIFX", b"RF64") or head[8:] != b"WAVE":
            return  # SciPy reports the error
        order: Literal["little", "big"] = "big" if head[:4] == b"RIFX" else "little"
        there = stream.seek(0, os.SEEK_END)
        stated = there if head[:4] == b"RF64" else int.from_bytes(head[4:8], order) + 8
        if stated == 2**32 + 7:
            raise _open_wav()
        at, long = 12, 0
        while at < min(stated, there):
            stream.seek(at)
            chunk = stream.read(32)
            size = int.from_bytes(chunk[4:8], order)
            if chunk[:4] == b"ds64":
                long = int.from_bytes(chunk[16:24], "little")
            if chunk[:4] == b"data":
                size = long if head[:4] == b"RF64" else size
                if size == 2**32 - 1 or (size == 0 and stated < there):
                    raise _open_wav()
            if at + 8 + size > there:
                missing = at + 8 + size - there
                raise TwingapError(f"is truncated: {missing} bytes are missing", mend="copy or write it again")
            if chunk[:4] == b"data":
                break
            at += 8 + size + size % 2
        else:
            if stated < there:
                raise _open_wav()
            raise TwingapError("ends before its samples begin", mend="copy or write it again")
        if stated > there:
            raise TwingapError(f"is truncated: {stated - there} bytes are missing", mend="copy or write it again")


def _open_wav() -> TwingapError:
    return TwingapError(
        "does not say how many samples it holds, as recorders leave it that crash or write to a pipe",
        mend="save it again with an audio tool that counts them",
    )


def _inspect_wav(path: Path) -> Contents:
    rate, data = _read_wav(path)
    channels = 1 if data.ndim == 1 else data.shape[1]
    return Contents(tuple(Entry(str(i), len(data)) for i in range(channels)), fs_hz=float(rate))


def _load_wav(path: Path, name: str, place: int) -> Any:
    _, data = _read_wav(path)
    values = data if data.ndim == 1 else data[:, place]
    # Full scale = 1, the convention of audio software, so that a recording reads the same in 8, 16, 24 or 32 bits or as
    # float. SciPy returns 24-bit samples in the upper bytes of 32.
    if values.dtype.kind == "u":
        return (values.astype(np.float64) - 128) / 128
    if values.dtype.kind == "i":
        return values / 2.0 ** (8 * values.dtype.itemsize - 1)
    return values


FORMATS: Final = {
    ".npy": Format(_inspect_npy, _load_npy),
    ".npz": Format(_inspect_npz, _load_npz),
    ".mat": Format(_inspect_mat, _load_mat),
    ".csv": Format(_inspect_csv, _load_csv),
    ".parquet": Format(_inspect_parquet, _load_parquet),
    ".wav": Format(_inspect_wav, _load_wav),
}
"""By suffix, in lower case."""
