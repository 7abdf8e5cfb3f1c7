"""Manifests of public data sets, as Croissant JSON-LD (https://docs.mlcommons.org/croissant, 1.0).

data_manifests/cwru.json --read_manifest--> Manifest: owner, licence, citation, files with size and checksum, facts

Fields that Croissant does not define have the prefix `twingap:`: the git blob id where no sha256 is known, whether a
file is the owner's own or a third party's conversion, and which file a conversion replaces. Facts of each recording
(fault, load, speed, sampling rate) are the record set `recordings` with inline data, so that readers need no tables of
their own.
"""

from __future__ import annotations

import fnmatch
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from twingap.errors import TwingapError

CROISSANT = "http://mlcommons.org/croissant/1.0"
_OWN = "twingap:"


@dataclass(frozen=True)
class DataFile:
    """One file of a data set.

    Parameters
    ----------
    path : str
        Path below the data root, with forward slashes.
    url : str or None
        The owner's download address; None when it cannot be downloaded separately.
    size_bytes : int or None
    sha256, git_blob : str or None
        Hex digests; `git_blob` is SHA-1 over ``"blob <size>\\0"`` and the bytes. None = unknown.
    converted : bool
        Whether a third party changed the form of the owner's file.
    provenance : str or None
        Origin of a converted file.
    stands_in_for : str or None
        Path of the owner's file that it replaces when that is absent.
    contained_in : str or None
        Path of the archive that holds it.
    holds : tuple of str
        Suffixes of the archives within this archive, such as ".rar", that Python cannot unpack.
    """

    path: str
    url: str | None
    size_bytes: int | None = None
    sha256: str | None = None
    git_blob: str | None = None
    converted: bool = False
    provenance: str | None = None
    stands_in_for: str | None = None
    contained_in: str | None = None
    holds: tuple[str, ...] = ()

    @property
    def checksum(self) -> str | None:
        """The strongest digest known, as ``algorithm:hex``."""
        if self.sha256:
            return f"sha256:{self.sha256}"
        return f"git-blob:{self.git_blob}" if self.git_blob else None


@dataclass(frozen=True)
class FilePattern:
    """Expected files that are known by the pattern of their paths only, without size or checksum.

    Parameters
    ----------
    pattern : str
        Path below the data root; ``*`` matches any characters.
    contained_in : str or None
        Path of the archive that holds them.
    count : int or None
        Number of files in the complete set.
    """

    pattern: str
    contained_in: str | None = None
    count: int | None = None

    def matches(self, path: str) -> bool:
        """Whether `path` (below the data root, forward slashes) is one of these files."""
        return fnmatch.fnmatchcase(path, self.pattern)


@dataclass(frozen=True)
class Manifest:
    """A data set: owner, terms of use, files and recordings.

    Parameters
    ----------
    name : str
        Short name; also the folder below the data root.
    title, description, url, licence, citation : str
        `licence` states explicitly where the owner publishes none.
    bearing : str or None
        Name in `twingap.bearing.BEARINGS`.
    unit : str
        Unit of all samples, as in record sets.
    how_to_get : str or None
        Instructions where the set cannot be downloaded by a program; None where `fetch` can.
    made_here : bool
        Whether twingap simulates the records (virtual rigs).
    files, patterns : tuple
    recordings : tuple of Mapping
        Facts of each recording, by field name; None values are left out.
    card : Mapping
        What `twingap.data.cards` shows and recordings do not state: channels, loads, labels, traps, suits.
    """

    name: str
    title: str
    description: str
    url: str | None
    licence: str
    citation: str
    bearing: str | None
    unit: str
    how_to_get: str | None
    made_here: bool
    files: tuple[DataFile, ...]
    patterns: tuple[FilePattern, ...]
    recordings: tuple[Mapping[str, Any], ...]
    card: Mapping[str, Any]

    def file(self, path: str) -> DataFile | None:
        """The file at this path below the data root, or None."""
        return next((f for f in self.files if f.path == path), None)

    @property
    def size_bytes(self) -> int | None:
        """Bytes to download from the owner; None when unknown."""
        sizes = [f.size_bytes for f in self.files if f.url]
        known = [s for s in sizes if s is not None]
        return sum(known) if sizes and len(known) == len(sizes) else None


def manifests_folder() -> Path:
    """Folder of the manifests: inside an installed package, or at the root of a checkout."""
    installed = Path(__file__).parent / "manifests"
    checkout = Path(__file__).parents[3] / "data_manifests"
    for folder in (installed, checkout):
        if folder.is_dir():
            return folder
    raise TwingapError("the data manifests are missing", where=installed, mend="install twingap anew")


def manifest_names() -> tuple[str, ...]:
    """Names of the data sets, in alphabetical order."""
    return tuple(sorted(path.stem for path in manifests_folder().glob("*.json")))


def manifest_of(name: str) -> Manifest:
    """The manifest of a data set, by its name.

    Raises
    ------
    TwingapError
        For an unknown name.
    """
    names = manifest_names()
    if name not in names:
        raise TwingapError(f"no data set {name!r}", mend=f"use one of {', '.join(names)}")
    return read_manifest(manifests_folder() / f"{name}.json")


def read_manifest(path: str | os.PathLike[str]) -> Manifest:
    """Read a Croissant manifest.

    Raises
    ------
    TwingapError
        When it cannot be read, is not JSON, or lacks a required key; names file and key.
    """
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror}", where=path) from error
    except ValueError as error:
        raise TwingapError(f"is not JSON: {error}", where=path) from error
    try:
        return _from_croissant(document)
    except KeyError as error:
        raise TwingapError(f"key {error.args[0]!r} is missing", where=path) from error
    except (TypeError, AttributeError, ValueError, IndexError) as error:
        raise TwingapError(f"is not a Croissant data set: {error}", where=path) from error


def _from_croissant(document: Mapping[str, Any]) -> Manifest:
    """The parts of a Croissant document that twingap uses."""
    if document.get("conformsTo") != CROISSANT:
        raise ValueError(f"conformsTo = {document.get('conformsTo')!r}, {CROISSANT!r} expected")
    files: list[DataFile] = []
    patterns: list[FilePattern] = []
    for item in document.get("distribution", ()):
        archive = item.get("containedIn", {}).get("@id")
        if item["@type"] == "cr:FileSet":
            includes = item["includes"]
            found = [includes] if isinstance(includes, str) else includes
            count = item.get(f"{_OWN}fileCount")
            patterns += [FilePattern(f"{document['name']}/{pattern}", archive, count) for pattern in found]
        else:
            files.append(_file(item, archive))
    recordings = [
        MappingProxyType({key.split("/", 1)[1]: value for key, value in row.items() if value is not None})
        for record_set in document.get("recordSet", ())
        if record_set["@id"] == "recordings"
        for row in record_set["data"]
    ]
    return Manifest(
        name=document["name"],
        title=document["alternateName"],
        description=document["description"],
        url=document.get("url"),
        licence=document["license"],
        citation=document["citeAs"],
        bearing=document.get(f"{_OWN}bearing"),
        unit=document.get(f"{_OWN}unit", ""),
        how_to_get=document.get(f"{_OWN}howToGet"),
        made_here=bool(document.get(f"{_OWN}madeHere", False)),
        files=tuple(files),
        patterns=tuple(patterns),
        recordings=tuple(recordings),
        card=MappingProxyType(dict(document.get(f"{_OWN}card", {}))),
    )


def _file(item: Mapping[str, Any], archive: str | None) -> DataFile:
    """One Croissant FileObject."""
    size, url = item.get("contentSize"), item.get("contentUrl", "")
    return DataFile(
        path=item["@id"],
        url=url if url.startswith(("https://", "http://")) else None,
        size_bytes=None if size is None else int(size.removesuffix("B")),
        sha256=item.get("sha256"),
        git_blob=item.get(f"{_OWN}gitBlobId"),
        converted=item.get(f"{_OWN}form") == "converted",
        provenance=item.get(f"{_OWN}provenance"),
        stands_in_for=item.get(f"{_OWN}standsInFor"),
        contained_in=archive,
        holds=tuple(item.get(f"{_OWN}holds", ())),
    )
