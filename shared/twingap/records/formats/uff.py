""".uff and .unv files (universal files, data sets 58): a channel per function, by its name or `set 3`."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np

from twingap.errors import TwingapError
from twingap.records.formats.base import Contents, Entry, Format, needed_for, not_real

_FIRST: Final = 1 << 16
"""Bytes from the beginning within which the first data set starts."""
_LARGEST: Final = 1 << 30
"""Largest file that is read, in bytes; reading takes several times as much memory."""


def _functions(path: Path) -> list[tuple[int, dict[str, Any]]]:
    """Number and content of each data set 58."""
    with needed_for(path.suffix.lower(), "pyuff"):
        import pyuff
    with path.open("rb") as stream:
        if b"    -1" not in stream.read(_FIRST):
            raise TwingapError("holds no universal data set", mend="export it again")
    if (size := path.stat().st_size) > _LARGEST:  # pyuff reads all of it at once
        mend = "export fewer functions to a file"
        raise TwingapError(f"has {size / 1e6:.0f} MB, at most {_LARGEST / 1e6:.0f} MB are read", mend=mend)
    file = pyuff.UFF(str(path))
    kinds = np.atleast_1d(file.get_set_types())
    places = [i for i, kind in enumerate(kinds) if int(kind) == 58]
    return [(i, file.read_sets(i)) for i in places]


def _inspect(path: Path) -> Contents:
    found = _functions(path)
    labels = [str(content.get("id1", "")).strip() for _, content in found]
    unique = Counter(labels)
    entries, rates = [], set()
    for (i, content), label in zip(found, labels, strict=True):
        data = np.asarray(content.get("data", ()))
        name = label if label and label.upper() != "NONE" and unique[label] == 1 else f"set {i}"
        unit = str(content.get("ordinate_axis_units_lab", "")).strip()
        entries.append(Entry(name, data.size, not_real(data.dtype), unit="" if unit.upper() == "NONE" else unit))
        step = float(content.get("abscissa_inc", 0) or 0)
        if content.get("abscissa_spacing") == 1 and content.get("func_type") in (0, 1) and step > 0:
            rates.add(1 / step)
    return Contents(tuple(entries), fs_hz=rates.pop() if len(rates) == 1 else None)


def _load(path: Path, name: str, place: int) -> Any:
    return _functions(path)[place][1]["data"]


UFF = Format(_inspect, _load)
