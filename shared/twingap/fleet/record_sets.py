"""Search for record sets below a folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from twingap.errors import TwingapError

MARKS: Final = frozenset({"recordset.toml", "records.csv"})
"""Files of which one makes a folder a record set; where the other is missing, reading it says so."""


def find_record_sets(folder: str | os.PathLike[str], leave_out: str | os.PathLike[str]) -> list[str]:
    """Relative paths of all record sets in and below a folder, sorted; "." is the folder itself.

    Links to folders are followed, hidden folders are left out. A folder that cannot be listed is one of the paths, so
    that reading it says why.

    Parameters
    ----------
    folder : path-like
    leave_out : path-like
        Folder of the results, which is not searched.

    Raises
    ------
    TwingapError
        When there is no such folder, or no record set.
    """
    top, out = Path(folder), Path(leave_out).resolve()
    if not top.is_dir():
        raise TwingapError("no such folder", where=top, mend="name the folder that holds the record sets")
    if top.resolve() == out:
        raise TwingapError("is the folder of the records", where=leave_out, mend="name another folder with --out")
    found: set[Path] = set()
    seen: set[Path] = set()
    unlisted = lambda error: found.add(Path(error.filename))  # noqa: E731
    for place, folders, names in os.walk(top, followlinks=True, onerror=unlisted):
        here = Path(place).resolve()
        if here in seen or here == out:  # a link back, or results
            folders.clear()
            continue
        seen.add(here)
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        if MARKS & set(names):
            found.add(Path(place))
    if not found:
        mend = "a record set is a folder with recordset.toml and records.csv; `twingap import` makes them"
        raise TwingapError("holds no record set", where=top, mend=mend)
    return sorted(path.relative_to(top).as_posix() for path in found)
