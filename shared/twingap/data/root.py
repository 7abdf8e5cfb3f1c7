"""Data root: `--root` or TWINGAP_DATA, with one folder per data set."""

from __future__ import annotations

import os
from pathlib import Path

from twingap.data.manifest import Manifest
from twingap.errors import TwingapError

VARIABLE = "TWINGAP_DATA"


class NotAtHandError(TwingapError):
    """No file of a data set lies under the data root, or there is no root; callers may continue without the set.

    Present files that cannot be read raise `TwingapError` instead.
    """


def data_root(root: str | os.PathLike[str] | None = None, *, must_exist: bool = True) -> Path:
    """The data root: `root` if given, else the environment variable TWINGAP_DATA.

    Raises
    ------
    NotAtHandError
        When neither is set, or the folder does not exist and `must_exist`.
    TwingapError
        When it is a file.
    """
    text = os.fspath(root) if root is not None else os.environ.get(VARIABLE, "")
    mend = f"let {VARIABLE} or --root name the folder that holds the data sets"
    if not text:
        raise NotAtHandError("no data root is set", mend=mend)
    path = Path(text).expanduser()
    if path.exists() and not path.is_dir():
        raise TwingapError("is a file, a folder expected", where=path, mend=mend)
    if must_exist and not path.exists():
        raise NotAtHandError("does not exist", where=path, mend=mend)
    return path


def not_at_hand(facts: Manifest, root: Path, what: str) -> NotAtHandError:
    """The error for a data set of which no requested file lies under the root."""
    mend = facts.how_to_get or f"run `twingap data fetch {facts.name}`, or take the files from {facts.url}"
    return NotAtHandError(f"holds {what}", where=root / facts.name, mend=mend)
