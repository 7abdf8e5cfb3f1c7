"""Where data sets lie on this machine: `--root` or TWINGAP_DATA, one folder per data set below it."""

from __future__ import annotations

import os
from pathlib import Path

from twingap.errors import TwingapError

VARIABLE = "TWINGAP_DATA"


def data_root(root: str | os.PathLike[str] | None = None, *, must_exist: bool = True) -> Path:
    """The data root: `root` if given, else the environment variable TWINGAP_DATA.

    Raises
    ------
    TwingapError
        When neither is set, or the folder does not exist and `must_exist`.
    """
    text = os.fspath(root) if root is not None else os.environ.get(VARIABLE, "")
    if not text:
        raise TwingapError(
            "no data root is set", mend=f"set {VARIABLE} or give --root: the folder that holds the data sets"
        )
    path = Path(text).expanduser()
    if path.exists() and not path.is_dir():
        raise TwingapError(
            "is a file, a folder expected", where=path, mend=f"let {VARIABLE} or --root name the data root"
        )
    if must_exist and not path.exists():
        raise TwingapError(
            "does not exist", where=path, mend=f"let {VARIABLE} or --root name the folder that holds the data sets"
        )
    return path
