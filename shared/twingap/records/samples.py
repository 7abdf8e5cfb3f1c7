"""Vectors of samples in the file formats of record sets.

file --inspect--> SampleFile: names, lengths, types, by the header --find--> Channel --load--> float64 [samples]

.npy        one vector, or a channel per column of a matrix, by index; `row 0` where rows are records
.npz        a channel per key; columns of matrices as `data[1]`, rows as `data[row 1]`
.mat        the same; fields and cells as `bearing.gs`, `Y/vibration_1`, `c[1]`; MATLAB 7.3 needs h5py
.csv .txt .tsv .asc .dat .lvm
            tables of text: separators, decimal commas, lines above the table and units are found and noted; what may
            be read in two ways is refused; channels by name or index
.parquet    columns by name or index; lists of numbers as `x[row 0]`
.wav        channels by index; integers are scaled to full scale = 1
.h5 .hdf5 .tdms .uff .unv .mf4
            with the extra twingap[formats]

No file is ever unpickled.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.files import kind_of
from twingap.records.formats import FORMATS, not_real, row_or_column

Array = NDArray[np.float64]

SUFFIXES: Final[tuple[str, ...]] = tuple(FORMATS)
"""Supported file types."""


@dataclass(frozen=True)
class Channel:
    """One vector of samples in a file, its values still on disk.

    Parameters
    ----------
    path : Path
    name : str
        Key, column name, or index where columns have no names.
    place : int
        Index among the file's channels.
    n_samples : int
        From the file's header.
    problem, mend : str or None
        Why it is not a vector of samples, and the remedy; None when it is one.
    unit : str
        As the file states it; empty = not stated.
    """

    path: Path
    name: str
    place: int
    n_samples: int
    problem: str | None = None
    mend: str | None = None
    unit: str = ""

    def load(self) -> Array:
        """The samples, as float64.

        Returns
        -------
        Array [n_samples]
            A copy, safe to modify.

        Raises
        ------
        TwingapError
            When the file is no longer readable, or a sample is missing, NaN or infinite.
        """
        with _explained(self.path):
            values = np.asarray(FORMATS[self.path.suffix.lower()].load(self.path, self.name, self.place))
            if problem := not_real(values.dtype):
                raise TwingapError(problem, where=self.where)
            with np.errstate(invalid="ignore", over="ignore"):  # detected below as samples that are not finite
                fresh = values.flags.owndata and values.flags.writeable and values.dtype == np.float64
                samples = np.array(values, dtype=np.float64, copy=None if fresh and values.ndim == 1 else True).ravel()
        if samples.size != self.n_samples:
            raise TwingapError(f"holds {samples.size} samples, {self.n_samples} expected", where=self.where)
        if not (finite := np.isfinite(samples)).all():
            place = int(np.argmin(finite))
            raise TwingapError(
                f"sample {place} is {samples[place]}, finite samples expected",
                where=self.where,
                mend="mend the sample or leave the record out",
            )
        return samples

    @property
    def where(self) -> str:
        """File and channel, for errors."""
        return f"{self.path}, channel {self.name}"


@dataclass(frozen=True)
class SampleFile:
    """Channels of a file, from its header.

    Parameters
    ----------
    path : Path
    channels : tuple[Channel, ...]
    keyed : bool
        Whether channels are known by key alone (.npz, .mat), not by index.
    fs_hz : float or None
        Sampling rate stated by the file, Hz; None where it states none, or several.
    rows : Mapping[str, tuple[int, int]]
        Number and length of the rows of each matrix, by name.
    notes : tuple of str
        How the file was understood, where that is not evident.
    """

    path: Path
    channels: tuple[Channel, ...]
    keyed: bool = False
    fs_hz: float | None = None
    rows: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def find(self, channel: str | None = None) -> Channel:
        """The channel of this name or index; the only one when None.

        Single numbers (a speed, a rate) in files with named arrays are no channels beside others. A row of a matrix is
        `data[row 1]`, or `row 1` in a .npy file.

        Raises
        ------
        TwingapError
            When there is no such channel, None is given for several channels, or it is not a vector of samples.
        """
        found = self._named(channel) if channel else self._only()
        if found.problem is not None:
            raise TwingapError(found.problem, where=found.where, mend=found.mend)
        if found.n_samples < 1:
            raise TwingapError("is empty, at least 1 sample expected", where=found.where)
        return found

    def _named(self, channel: str) -> Channel:
        named = [c for c in self.channels if c.name == channel]
        if len(named) > 1:
            raise TwingapError(
                f"has {len(named)} channels {channel!r}", where=self.path, mend="give the column's index"
            )
        if named:
            return named[0]
        part = row_or_column(channel)
        if part is not None and part[1] == "row" and part[0] in self.rows:
            return self._row(channel, part[2], *self.rows[part[0]])
        # Longer texts are no index, and Python limits the conversion of long digit strings.
        if not self.keyed and channel.isdecimal() and len(channel) < 10 and self.channels:
            if int(channel) < len(self.channels):
                return self.channels[int(channel)]
            if len(self.channels) == 1 and self.channels[0].problem and "" in self.rows:
                return self.channels[0]
        base = channel if part is None else part[0]
        refused = [c for c in self.channels if c.name == base and c.problem is not None]
        if refused:  # a column of a matrix whose columns are no channels
            return refused[0]
        parts = [c.name for c in self.channels if c.name.startswith(tuple(channel + mark for mark in "[./"))]
        if parts:
            what = f"channel {channel!r} holds {len(parts)} arrays"
            raise TwingapError(what, where=self.path, mend=f"name one of {_listed(parts)}")
        raise TwingapError(f"has no channel {channel!r}", where=self.path, mend=f"it has {self._listing()}")

    def _row(self, channel: str, row: int, rows: int, length: int) -> Channel:
        if row >= rows:
            raise TwingapError(f"has no row {row}", where=f"{self.path}, channel {channel}", mend=f"it has {rows} rows")
        return Channel(self.path, channel, row, length)

    def _only(self) -> Channel:
        if not self.channels:
            raise TwingapError("holds no samples", where=self.path)
        if len(self.channels) == 1:
            return self.channels[0]
        arrays = list(self.channels)
        if self.keyed:  # single numbers and texts are about the record; a matrix or a list of lists may be it
            arrays = [c for c in self.channels if c.n_samples != 1 and (c.problem is None or c.n_samples)]
        vectors = [c for c in arrays if c.problem is None]
        if len(vectors) == 1 and (len(arrays) == 1 or not self.keyed):
            return vectors[0]
        if vectors or not self.keyed:
            what = f"holds {len(self.channels)} channels and none is named"
            raise TwingapError(what, where=self.path, mend=f"name one of {self._listing()}")
        problems = [f"{c.name} {c.problem}" + (f" ({c.mend})" if c.mend else "") for c in self.channels if c.problem]
        what = "holds no vector of samples, only single numbers" + (f": {'; '.join(problems[:4])}" if problems else "")
        raise TwingapError(what, where=self.path, mend=f"name one of {self._listing()}")

    def _listing(self) -> str:
        return _listed([c.name or f"{c.place} (no name)" for c in self.channels])


def _listed(names: list[str]) -> str:
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "") or "none"


def inspect(path: str | os.PathLike[str]) -> SampleFile:
    """Channels of a file of samples, without loading the values.

    A text file does not state its length: its lines are counted.

    Parameters
    ----------
    path : path-like
        One of `SUFFIXES`; the type is given by the suffix, in either case.

    Raises
    ------
    TwingapError
        When the file is missing, a folder, of another type, damaged, or would need unpickling.
    """
    path = Path(path)
    with _explained(path):
        kind = kind_of(path)
        if kind == "missing":
            mend = "write / between folders" if "\\" in path.name else "check the name and the folder"
            raise TwingapError("no such file", mend=mend)
        if kind != "file":
            raise TwingapError("is a folder, a file expected" if kind == "folder" else "is not a regular file")
        known = FORMATS.get(path.suffix.lower())
        if known is None:
            raise TwingapError(f"files of type {path.suffix!r} are not read", mend=f"use one of {', '.join(SUFFIXES)}")
        held = known.inspect(path)
    channels = tuple(
        Channel(path, e.name, place, e.n_samples, e.problem, e.mend, e.unit) for place, e in enumerate(held.entries)
    )
    return SampleFile(path, channels, held.keyed, held.fs_hz, held.rows, held.notes)


def load(path: str | os.PathLike[str], channel: str | None = None) -> Array:
    """The samples of one channel of a file, as float64 [samples]. See `inspect`, `SampleFile.find`, `Channel.load`."""
    return inspect(path).find(channel).load()


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Convert the errors that a parser raises on a damaged file to `TwingapError`."""
    try:
        yield
    except TwingapError as error:
        raise TwingapError(error.what, where=error.where or path, mend=error.mend) from error
    except UnicodeDecodeError as error:
        raise TwingapError(f"is no text in {error.encoding}", where=path, mend="save it as UTF-8") from error
    except MemoryError as error:
        raise TwingapError("does not fit in memory", where=path, mend="cut it into shorter records") from error
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror or error}", where=path) from error
    except Exception as error:  # parsers raise almost any error on damaged bytes
        reason = str(error) or type(error).__name__
        what = f"is not a whole {path.suffix.lower()} file: {reason[:200]}"
        raise TwingapError(what, where=path, mend="copy or write it again") from error
