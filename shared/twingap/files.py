"""Files written whole or not at all, and their digests."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from twingap.errors import TwingapError


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it into place when the block ends well, remove it otherwise.

    Parameters
    ----------
    path : path-like
        The file to write. Its folder is made when missing.

    Yields
    ------
    Path
        Temporary file with the same suffix, to be written by the caller.

    Raises
    ------
    TwingapError
        When the place cannot be written (no permission, no space, a file where a folder should be).
    """
    target = Path(path)
    with _explained(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            raise IsADirectoryError(f"{target} is a folder")
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            # mkstemp makes files private to their owner; the result should be as readable as any other file.
            umask = os.umask(0)
            os.umask(umask)
            temporary.chmod(0o666 & ~umask)
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def replacing_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; move it into place when the block ends well, remove it otherwise.

    An existing folder is replaced only if it is empty.

    Raises
    ------
    TwingapError
        When `path` holds something already, or cannot be written.
    """
    target = Path(path)
    with _explained(target):
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise TwingapError("exists already and is not an empty folder", where=target, mend="name a new folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        try:
            yield temporary
            umask = os.umask(0)
            os.umask(umask)
            temporary.chmod(0o777 & ~umask)
            os.replace(temporary, target)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def sha256(path: str | os.PathLike[str]) -> str:
    """Hex sha256 of a file, read in one pass at disk speed."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@contextmanager
def _explained(target: Path) -> Iterator[None]:
    """Turn the operating system's refusals into the one error that users see."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise TwingapError(
            f"cannot be written: {reason}", where=target, mend="choose a folder that is writable and has space"
        ) from error
