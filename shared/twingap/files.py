"""Atomic writing of files and folders, and digests of files.

Both context managers give a temporary path next to the target and rename it into place at the end, which is atomic
for the file system. After an error or an interruption (Ctrl-C) the previous state is left, and folders created on the
way are removed again.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path next to `path`; move it into place when the block succeeds, else remove it.

    Parameters
    ----------
    path : path-like
        The file to write. Its folder is created when missing. A symbolic link is followed: its target is replaced.

    Yields
    ------
    Path
        Temporary, empty file with the same suffix, to be written by the caller.

    Raises
    ------
    TwingapError
        When the path cannot be written (no permission, no space, a file where a folder should be, a device).
    """
    shown = Path(path)
    with _explained(shown):
        target = Path(os.path.realpath(shown))
        if target.is_dir():
            raise TwingapError("is a folder, a file expected", where=shown, mend="name a file")
        if target.exists() and not target.is_file():
            # Otherwise root could rename over /dev/null.
            raise TwingapError("is not a regular file", where=shown, mend="name a file")
        with _parents(target.parent):
            temporary = _beside(target)
            temporary.touch(exist_ok=False)
            try:
                yield temporary
                temporary.replace(target)
            finally:
                temporary.unlink(missing_ok=True)


@contextmanager
def replacing_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder next to `path`; move it into place when the block succeeds, else remove it.

    An existing folder is replaced only if it is empty.

    Raises
    ------
    TwingapError
        When `path` is a file or a folder with content, or cannot be written.
    """
    shown = Path(path)
    with _explained(shown):
        target = Path(os.path.realpath(shown))
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise TwingapError("exists already and is not an empty folder", where=shown, mend="name a new folder")
        if target.is_mount():
            # Checked before the work: a rename over a mount point would fail at its end.
            raise TwingapError("is a mount point", where=shown, mend="name a new folder inside it")
        with _parents(target.parent):
            temporary = _beside(target)
            temporary.mkdir()
            try:
                yield temporary
                with suppress(FileNotFoundError):
                    target.rmdir()
                temporary.replace(target)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)


def try_folder(folder: str | os.PathLike[str]) -> None:
    """Check that a folder is writable, by writing and removing a file, so that errors occur before long work.

    Raises
    ------
    TwingapError
        When it is not.
    """
    probe = Path(folder) / ".writable"
    with replacing(probe) as temporary:
        temporary.touch()
    probe.unlink()


class _UndoError(Exception):
    """Ends `try_outputs`, so that its temporary files are removed."""


def try_outputs(folder: str | os.PathLike[str], files: Iterable[str], folders: Iterable[str] = ()) -> None:
    """Check that these files and new folders can be written into a folder, and restore its state.

    Raises
    ------
    TwingapError
        As `replacing` and `replacing_folder`.
    """
    with suppress(_UndoError), ExitStack() as places:
        for name in files:
            places.enter_context(replacing(Path(folder) / name))
        for name in folders:
            places.enter_context(replacing_folder(Path(folder) / name))
        raise _UndoError


def kind_of(path: str | os.PathLike[str]) -> Literal["file", "folder", "other", "missing"]:
    """Type of the entry at a path; "other" are devices and pipes.

    Raises
    ------
    TwingapError
        When it cannot be determined: no permission, or an impossible name.
    """
    try:
        mode = Path(path).stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return "missing"
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror or error}", where=path) from error
    except ValueError as error:
        raise TwingapError("is no file name", where=repr(str(path)), mend="leave out null characters") from error
    return "file" if stat.S_ISREG(mode) else "folder" if stat.S_ISDIR(mode) else "other"


@contextmanager
def open_text(path: str | os.PathLike[str], newline: str | None = None, most: int = 1 << 26) -> Iterator[TextIO]:
    """Open a file of UTF-8 text, with or without a byte-order mark.

    Parameters
    ----------
    path : path-like
    newline : str or None
        As in `open`.
    most : int
        Size in bytes above which it is refused, as it is held in memory.

    Raises
    ------
    TwingapError
        When it is missing, no regular file (reading a pipe may never end), too large, or not UTF-8.
    """
    if kind_of(path) == "other":
        raise TwingapError("is not a regular file", where=path, mend="save its content as a file")
    try:
        with open(path, encoding="utf-8-sig", newline=newline) as stream:
            if (size := os.fstat(stream.fileno()).st_size) > most:
                raise TwingapError(f"has {size / 1e6:.0f} MB, at most {most / 1e6:.0f} MB expected", where=path)
            yield stream
    except UnicodeDecodeError as error:
        raise TwingapError("is not UTF-8 text", where=path, mend="save it as UTF-8") from error
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror or error}", where=path) from error


def save_npy(path: str | os.PathLike[str], array: NDArray[Any]) -> None:
    """Write an array as .npy, or raise OSError.

    `numpy.save` silently truncates an array on a full disk, as it does not check the closing of its C stream. Python's
    own streams do.
    """
    array = np.ascontiguousarray(array)
    with open(path, "wb") as stream:
        np.lib.format.write_array_header_1_0(stream, np.lib.format.header_data_from_array_1_0(array))
        stream.write(array.data)


def sha256(path: str | os.PathLike[str]) -> str:
    """Hex sha256 of a file's content."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _beside(target: Path) -> Path:
    """A new hidden name in the same folder, short enough for any file system."""
    stem = target.stem.encode(errors="ignore")[:100].decode(errors="ignore")
    return target.with_name(f".{stem}-{secrets.token_hex(6)}{target.suffix if len(target.suffix) < 20 else ''}")


@contextmanager
def _parents(folder: Path) -> Iterator[None]:
    """Create a folder and its parents; when the block fails, remove those created that are still empty."""
    places = (folder, *folder.parents)
    made = [place for place in places if not place.exists()]
    there = places[len(made)]
    if not there.is_dir():
        raise TwingapError("is not a folder, a folder expected", where=there, mend="name another place to write to")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        with suppress(OSError):
            for place in made:
                place.rmdir()
        raise


@contextmanager
def _explained(target: Path) -> Iterator[None]:
    """Convert errors of the operating system to `TwingapError`."""
    if "\0" in str(target):
        raise TwingapError("is no file name", where=repr(str(target)), mend="leave out null characters")
    try:
        yield
    except OSError as error:
        # On a full disk NumPy reports the number of values that it could not write.
        reason = error.strerror or f"the disk may be full ({error})"
        mend = "choose a folder that is writable and has space"
        named = Path(os.fsdecode(error.filename)) if isinstance(error.filename, (str, bytes)) else None
        if named is not None and not _near(named, target):
            # The error in the block concerns another file, one that the caller reads.
            raise TwingapError(f"cannot be used: {reason}", where=named) from error
        raise TwingapError(f"cannot be written: {reason}", where=target, mend=mend) from error


def _near(named: Path, target: Path) -> bool:
    """Whether a path is the target, one of its parents, or in a temporary path next to it."""
    named, target = Path(os.path.realpath(named)), Path(os.path.realpath(target))
    if named == target or named in target.parents:
        return True
    return any(p.parent == target.parent and p.name.startswith(".") for p in (named, *named.parents))
