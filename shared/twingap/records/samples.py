"""Vectors of samples in the six file formats of record sets.

file --inspect--> SampleFile: names, lengths, types, by the header --find--> Channel --load--> float64 [samples]

.npy      one vector; a 2-D array has one channel per column, by index, and no more channels than samples
.npz      one channel per key
.mat      one channel per variable (MATLAB 5 to 7; version 7.3 is refused, with a remedy)
.csv      comma-separated, decimal points, UTF-8, with or without a header row (of names, or 0, 1, 2, ... where
          samples have decimal points; ambiguous first rows are refused); channels by name or index
.parquet  channels by column name or index
.wav      channels by index; integers are scaled to full scale = 1

No file is ever unpickled.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.files import kind_of
from twingap.records.formats import FORMATS, not_real

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
    problem : str or None
        Why it is not a vector of samples; None when it is one.
    """

    path: Path
    name: str
    place: int
    n_samples: int
    problem: str | None = None

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
                samples = np.array(values, dtype=np.float64).ravel()
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
        Sampling rate stated by the file (.wav), Hz.
    """

    path: Path
    channels: tuple[Channel, ...]
    keyed: bool = False
    fs_hz: float | None = None

    def find(self, channel: str | None = None) -> Channel:
        """The channel of this name or index; the only one when None.

        Scalars (a speed, a rate) in .npz and .mat files do not count as further channels next to a single vector.

        Raises
        ------
        TwingapError
            When there is no such channel, None is given for several channels, or it is not a vector of samples.
        """
        found = self._named(channel) if channel else self._only()
        if found.problem is not None:
            raise TwingapError(found.problem, where=found.where)
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
        # Longer texts are no index, and Python limits the conversion of long digit strings.
        if not self.keyed and channel.isdecimal() and len(channel) < 10 and int(channel) < len(self.channels):
            return self.channels[int(channel)]
        raise TwingapError(f"has no channel {channel!r}", where=self.path, mend=f"it has {self._listing()}")

    def _only(self) -> Channel:
        if not self.channels:
            raise TwingapError("holds no samples", where=self.path)
        vectors = [c for c in self.channels if c.problem is None]
        if self.keyed:
            vectors = [c for c in vectors if c.n_samples != 1] or vectors
        if len(vectors) == 1:
            return vectors[0]
        if len(self.channels) == 1:
            return self.channels[0]
        what = f"holds {len(self.channels)} channels and none is named"
        raise TwingapError(what, where=self.path, mend=f"name one of {self._listing()}")

    def _listing(self) -> str:
        names = [c.name or f"{c.place} (no name)" for c in self.channels]
        return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "") or "none"


def inspect(path: str | os.PathLike[str]) -> SampleFile:
    """Channels of a file of samples, without loading the values.

    A CSV does not state its length: its lines are counted.

    Parameters
    ----------
    path : path-like
        A .npy, .npz, .mat, .csv, .parquet or .wav file; the type is given by the suffix, in either case.

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
        entries, keyed, fs_hz = known.inspect(path)
    channels = (Channel(path, e.name, place, e.n_samples, e.problem) for place, e in enumerate(entries))
    return SampleFile(path, tuple(channels), keyed, fs_hz)


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
        raise TwingapError("is not UTF-8 text", where=path, mend="save it as UTF-8") from error
    except MemoryError as error:
        raise TwingapError("does not fit in memory", where=path, mend="cut it into shorter records") from error
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror or error}", where=path) from error
    except Exception as error:  # parsers raise almost any error on damaged bytes
        reason = str(error) or type(error).__name__
        what = f"is not a whole {path.suffix.lower()} file: {reason[:200]}"
        raise TwingapError(what, where=path, mend="copy or write it again") from error
