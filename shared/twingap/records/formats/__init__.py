"""Formats of sample files: one module a format, each with inspection of a file and loading of one vector.

No file is ever unpickled. Parsers may raise anything on damaged files; `twingap.records.samples` converts the errors.
"""

from __future__ import annotations

from typing import Final

from twingap.records.formats.base import Contents, Entry, Format, not_real, row_or_column
from twingap.records.formats.hdf5 import HDF5
from twingap.records.formats.mat import MAT
from twingap.records.formats.mf4 import MF4
from twingap.records.formats.npy import NPY, NPZ
from twingap.records.formats.parquet import PARQUET
from twingap.records.formats.tdms import TDMS
from twingap.records.formats.text import TEXT
from twingap.records.formats.uff import UFF
from twingap.records.formats.wav import WAV

FORMATS: Final = {
    ".npy": NPY, ".npz": NPZ, ".mat": MAT, ".parquet": PARQUET, ".wav": WAV,
    ".csv": TEXT, ".txt": TEXT, ".tsv": TEXT, ".asc": TEXT, ".dat": TEXT, ".lvm": TEXT,
    ".h5": HDF5, ".hdf5": HDF5, ".tdms": TDMS, ".uff": UFF, ".unv": UFF, ".mf4": MF4,
}  # fmt: skip
"""By suffix, in lower case."""

__all__ = ["FORMATS", "Contents", "Entry", "Format", "not_real", "row_or_column"]
