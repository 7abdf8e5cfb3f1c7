"""Download of a data set from its owner: resumed after an interruption, verified, unpacked.

url --resuming download--> .fetch/FILE.part --size and checksum--> <root>/<name>/FILE --unpack--> the readers' layout

Only verified files are moved into place; a file that is present and correct is not downloaded again.
"""

from __future__ import annotations

import contextlib
import http.client
import os
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from twingap.data.manifest import DataFile, FilePattern, Manifest
from twingap.data.unpack import require_unpackers, unpack
from twingap.data.verify import digest, matches
from twingap.errors import TwingapError

Progress = Callable[[str, int, int | None], None]
"""Progress callback: progress(file, bytes present, size in bytes or None)."""

_BLOCK = 1 << 18
_AGAIN = "check the network and run the same command again: what is finished is kept, what broke off is resumed"


@dataclass(frozen=True)
class Fetched:
    """Result of a download.

    Parameters
    ----------
    downloaded, kept : tuple of Path
        Files downloaded now; files that were present and correct.
    unpacked : int
        Number of files extracted from archives.
    """

    downloaded: tuple[Path, ...]
    kept: tuple[Path, ...]
    unpacked: int


def fetch(facts: Manifest, root: str | os.PathLike[str], *, progress: Progress | None = None) -> Fetched:
    """Download a data set into the data root.

    Parameters
    ----------
    facts : Manifest
    root : path-like
        Data root; created when missing.
    progress : callable, optional

    Returns
    -------
    Fetched

    Raises
    ------
    TwingapError
        When the set cannot be downloaded by a program, the network is unreachable, a file differs from the manifest,
        or the root cannot be written.
    """
    folder = Path(root) / facts.name
    wanted = [f for f in facts.files if not f.converted and f.contained_in is None]
    by_hand = [f for f in wanted if f.url is None and not (Path(root) / f.path).is_file()]
    if facts.made_here or not wanted or by_hand:
        raise TwingapError(facts.how_to_get or f"cannot be downloaded; see {facts.url}", where=facts.name)
    downloaded: list[Path] = []
    kept: list[Path] = []
    unpacked = 0
    root_was_there = Path(root).exists()
    try:
        for file in wanted:
            place = Path(root) / file.path
            patterns = [p for p in facts.patterns if p.contained_in == file.path]
            if patterns and all(_complete(folder, facts.name, p) for p in patterns):
                continue
            require_unpackers(file.holds)
            if matches(file, place):
                kept.append(place)
            elif file.url is None:
                raise TwingapError(
                    f"is not the owner's file: {file.checksum} expected, {digest(place)} found",
                    where=place,
                    mend=facts.how_to_get,
                )
            else:
                download(file, place, progress=progress)
                downloaded.append(place)
            if patterns:
                unpacked += unpack(place, folder, facts.name, patterns)
    except OSError as error:
        raise TwingapError(
            f"cannot be written: {error.strerror or error}",
            where=folder,
            mend="choose a root with space and permission",
        ) from error
    finally:
        if not root_was_there:  # a failed download leaves no empty folders
            with contextlib.suppress(OSError):
                Path(root).rmdir()
    return Fetched(tuple(downloaded), tuple(kept), unpacked)


def download(file: DataFile, place: Path, *, progress: Progress | None = None) -> None:
    """Download one file, verify it and move it into place.

    Parameters
    ----------
    file : DataFile
    place : Path
        Target path.
    progress : callable, optional

    Raises
    ------
    TwingapError
        When it cannot be reached, or differs from the manifest; then no file is put in place.
    """
    if file.url is None:
        raise TwingapError("has no public address", where=file.path)
    staging = place.parent / ".fetch"
    staging.mkdir(parents=True, exist_ok=True)
    try:
        _into_place(file, place, staging, progress)
    finally:
        for folder in (staging, place.parent):  # a failed download leaves no empty folders
            with contextlib.suppress(OSError):
                folder.rmdir()


def _into_place(file: DataFile, place: Path, staging: Path, progress: Progress | None) -> None:
    import pooch

    pooch.get_logger().setLevel("WARNING")  # progress is shown by `progress`
    arrived = staging / place.name
    arrived.unlink(missing_ok=True)  # without a known hash, pooch would keep an existing file
    resuming = _Resuming(staging / f"{place.name}.part", file, progress)
    changed = "run again; if it repeats, the owner changed it"
    try:
        known = f"sha256:{file.sha256}" if file.sha256 else None
        pooch.retrieve(file.url, known, fname=place.name, path=staging, downloader=resuming)
    except ValueError as error:
        raise TwingapError(f"is not what the manifest says: {error}", where=file.url, mend=changed) from error
    if not matches(file, arrived):
        found = f"{digest(arrived, 'git-blob' if file.git_blob else 'sha256')} ({arrived.stat().st_size} bytes)"
        arrived.unlink()
        raise TwingapError(
            f"is not what the manifest says: {file.checksum} ({file.size_bytes} bytes) expected, {found} found",
            where=file.url,
            mend=changed,
        )
    arrived.replace(place)


class _Resuming:
    """A downloader for pooch that resumes an interrupted download.

    Parameters
    ----------
    part : Path
        Partial file.
    file : DataFile
    progress : callable or None
    """

    def __init__(self, part: Path, file: DataFile, progress: Progress | None) -> None:
        self._part, self._file, self._progress = part, file, progress

    def __call__(self, url: str, output_file: str, pup: Any, check_only: bool = False) -> None:
        have = self._part.stat().st_size if self._part.exists() else 0
        if self._file.size_bytes is not None and have > self._file.size_bytes:
            self._part.unlink()
            have = 0
        if not have or have != self._file.size_bytes:
            self._receive(url, have)
        self._part.replace(output_file)

    def _receive(self, url: str, have: int) -> None:
        headers = {"User-Agent": "twingap (data fetch)", **({"Range": f"bytes={have}-"} if have else {})}
        try:
            with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=30) as response:
                resumed = have > 0 and response.status == 206
                have = have if resumed else 0
                length = response.headers.get("Content-Length")
                total = have + int(length) if length else self._file.size_bytes
                with open(self._part, "ab" if resumed else "wb") as stream:
                    while block := response.read(_BLOCK):
                        stream.write(block)
                        have += len(block)
                        if self._progress is not None:
                            self._progress(self._file.path, have, total)
        except urllib.error.HTTPError as error:
            if error.code == 416:  # the partial file does not belong to the owner's present file
                self._part.unlink(missing_ok=True)
            raise TwingapError(
                f"the owner's server answers {error.code} {error.reason}", where=url, mend=_AGAIN
            ) from error
        except urllib.error.URLError as error:
            raise TwingapError(f"cannot be reached: {error.reason}", where=url, mend=_AGAIN) from error
        except (TimeoutError, ConnectionError, http.client.HTTPException) as error:
            raise TwingapError(f"broke off after {have} bytes: {error}", where=url, mend=_AGAIN) from error
        if total is not None and have < total:
            raise TwingapError(f"broke off after {have} of {total} bytes", where=url, mend=_AGAIN)


def _complete(folder: Path, name: str, pattern: FilePattern) -> bool:
    """Whether all files of a pattern are in place already."""
    if pattern.count is None or not folder.is_dir():
        return False
    found = sum(
        pattern.matches(f"{name}/{path.relative_to(folder).as_posix()}") for path in folder.rglob("*") if path.is_file()
    )
    return found >= pattern.count
