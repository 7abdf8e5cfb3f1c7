"""Verification of the files under the data root against the manifests.

Manifest + <root>/<name>/** --verify--> one Finding per file: ok, altered, missing, unexpected or unchecked

Sizes are compared first. Files are hashed in parallel threads, the largest first, so that speed is limited by the disk
(hashlib releases the global interpreter lock).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from twingap.data.manifest import DataFile, Manifest

Status = Literal["ok", "altered", "missing", "unexpected", "unchecked"]
Progress = Callable[[int], None]
_BLOCK = 1 << 20


@dataclass(frozen=True)
class Finding:
    """Verification result of one file.

    Parameters
    ----------
    path : str
        Path below the data root; for files known by pattern only, the pattern.
    status : {"ok", "altered", "missing", "unexpected", "unchecked"}
        unchecked: present, but neither size nor checksum is known.
    expected, found : str or None
        Checksums as ``algorithm:hex``, with the size where it differs; None = none.
    mend : str or None
        Remedy.
    """

    path: str
    status: Status
    expected: str | None = None
    found: str | None = None
    mend: str | None = None


@dataclass(frozen=True)
class Verification:
    """Verification result of one data set.

    Parameters
    ----------
    name : str
    findings : tuple of Finding
        In the manifest's order, then unexpected files.
    """

    name: str
    findings: tuple[Finding, ...]

    def count(self, status: Status) -> int:
        """Number of findings with this status."""
        return sum(finding.status == status for finding in self.findings)

    @property
    def intact(self) -> bool:
        """Whether no file is altered."""
        return not self.count("altered")

    @property
    def here(self) -> bool:
        """Whether any file of the set is present."""
        return any(finding.status != "missing" for finding in self.findings)


def verify(
    facts: Manifest, root: str | os.PathLike[str], *, quick: bool = False, progress: Progress | None = None
) -> Verification:
    """Check every file of a data set under the root against its manifest.

    Parameters
    ----------
    facts : Manifest
    root : path-like
        Data root; the set lies in ``root/<name>``. Hidden files are ignored.
    quick : bool
        Compare sizes only; files that agree count as unchecked.
    progress : callable, optional
        Called with the number of bytes hashed, from several threads.

    Returns
    -------
    Verification
    """
    present = dict(_present(Path(root), facts.name))
    expected = {file.path: file for file in facts.files}
    hashed = [path for path in present if path in expected or not any(p.matches(path) for p in facts.patterns)]
    digests: dict[str, str] = {} if quick else _digests(present, hashed, expected, progress)
    findings = [_listed(file, present, digests, facts, quick=quick) for file in facts.files]
    findings += _by_pattern(facts, present, expected)
    findings += [
        Finding(
            path, "unexpected", None, digests.get(path), "not part of the set: remove it if you did not put it there"
        )
        for path in hashed
        if path not in expected
    ]
    return Verification(facts.name, tuple(findings))


def bytes_to_hash(facts: Manifest, root: str | os.PathLike[str]) -> int:
    """Number of bytes that `verify` will read, for a progress bar."""
    listed = {file.path for file in facts.files}
    return sum(
        path.stat().st_size
        for name, path in _present(Path(root), facts.name)
        if name in listed or not any(p.matches(name) for p in facts.patterns)
    )


def digest(path: str | os.PathLike[str], algorithm: str = "sha256", progress: Progress | None = None) -> str:
    """Checksum of a file as ``algorithm:hex``.

    Parameters
    ----------
    path : path-like
    algorithm : {"sha256", "git-blob"}
        git-blob is SHA-1 over ``"blob <size>\\0"`` and the bytes, as git names files.
    progress : callable, optional
        Called with the number of bytes read.
    """
    with open(path, "rb", buffering=0) as stream:
        if algorithm == "git-blob":
            state = hashlib.sha1(f"blob {os.fstat(stream.fileno()).st_size}\0".encode(), usedforsecurity=False)
        else:
            state = hashlib.sha256()
        block = bytearray(_BLOCK)
        view = memoryview(block)
        while size := stream.readinto(block):
            state.update(view[:size])
            if progress is not None:
                progress(size)
    return f"{algorithm}:{state.hexdigest()}"


def matches(file: DataFile, path: Path) -> bool:
    """Whether a file agrees with the manifest: size and, where known, checksum."""
    if not path.is_file() or (file.size_bytes is not None and path.stat().st_size != file.size_bytes):
        return False
    return file.checksum is None or digest(path, _algorithm(file)) == file.checksum


def _algorithm(file: DataFile | None) -> str:
    return (file.checksum or "sha256:").split(":", 1)[0] if file else "sha256"


def _present(root: Path, name: str) -> Iterator[tuple[str, Path]]:
    """Files of a set, by their path below the root; links are followed, once."""
    seen: set[tuple[int, int]] = set()

    def walk(folder: Path) -> Iterator[Path]:
        status = folder.stat()
        if (status.st_dev, status.st_ino) in seen:
            return
        seen.add((status.st_dev, status.st_ino))
        for item in sorted(folder.iterdir()):
            if item.name.startswith("."):
                continue
            if item.is_dir():
                yield from walk(item)
            elif item.is_file():
                yield item

    folder = root / name
    if folder.is_dir():
        for path in walk(folder):
            yield path.relative_to(root).as_posix(), path


def _digests(
    present: dict[str, Path], wanted: Iterable[str], expected: dict[str, DataFile], progress: Progress | None
) -> dict[str, str]:
    """Checksums of the wanted files, hashed in parallel."""
    order = sorted(wanted, key=lambda path: -present[path].stat().st_size)

    def one(path: str) -> str:
        try:
            return digest(present[path], _algorithm(expected.get(path)), progress)
        except OSError as error:
            return f"unreadable: {error.strerror}"

    with ThreadPoolExecutor(max_workers=min(8, os.cpu_count() or 1)) as pool:
        return dict(zip(order, pool.map(one, order), strict=True))


def _listed(
    file: DataFile, present: dict[str, Path], digests: dict[str, str], facts: Manifest, *, quick: bool
) -> Finding:
    if file.path not in present:
        return Finding(file.path, "missing", file.checksum, None, _where_to_get(file, present, facts))
    size, found = present[file.path].stat().st_size, digests.get(file.path)
    mend = f"remove it and run `twingap data fetch {facts.name}`" if file.url else "take it anew from where you got it"
    if file.size_bytes is not None and size != file.size_bytes:
        expected = f"{file.checksum or 'no checksum'} ({file.size_bytes} bytes)"
        return Finding(file.path, "altered", expected, f"{found or 'not hashed'} ({size} bytes)", mend)
    if quick or file.checksum is None:
        return Finding(file.path, "unchecked", file.checksum, found)
    if found != file.checksum:
        return Finding(file.path, "altered", file.checksum, found, mend)
    return Finding(file.path, "ok", file.checksum, found)


def _where_to_get(file: DataFile, present: dict[str, Path], facts: Manifest) -> str:
    replacements = [f.path for f in facts.files if f.stands_in_for == file.path and f.path in present]
    if replacements:
        return f"{replacements[0]} replaces it; `twingap data fetch {facts.name}` gets the owner's"
    if file.converted:
        return "a third party's conversion, without public address: not needed where the owner's files are"
    held = [p for p in facts.patterns if p.contained_in == file.path]
    if held and any(p.matches(path) for p in held for path in present):
        return "its contents are there: not needed any more"
    return facts.how_to_get or f"run `twingap data fetch {facts.name}`"


def _by_pattern(facts: Manifest, present: dict[str, Path], expected: dict[str, DataFile]) -> list[Finding]:
    """One finding per pattern, with the number of its files present."""
    findings = []
    for pattern in facts.patterns:
        n = sum(path not in expected and pattern.matches(path) for path in present)
        whole = f"{pattern.count} files" if pattern.count is not None else None
        if n == 0 or (pattern.count is not None and n < pattern.count):
            mend = facts.how_to_get or f"run `twingap data fetch {facts.name}`"
            findings.append(Finding(pattern.pattern, "missing", whole, f"{n} files" if n else None, mend))
        if n:
            findings.append(Finding(pattern.pattern, "unchecked", whole, f"{n} files"))
    return findings
