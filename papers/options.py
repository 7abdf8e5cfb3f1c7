"""Checks of what the types of a configuration's entries cannot say, and configurations that other studies read too."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from twingap import TwingapError
from twingap.config import build, read_toml
from twingap.provenance import digest_of_value, plain

if TYPE_CHECKING:
    from papers.framework import Inputs, Work

T = TypeVar("T")


def read(kind: type[T], path: Path) -> T:
    """Read a configuration; errors name file, key, value and what was expected."""
    return build(kind, read_toml(path), path)


def as_input(work: Work) -> Inputs:
    """The configuration as an input of jobs, whose keys then depend on all of it but the profiles."""
    entries = {name: value for name, value in plain(work.options).items() if name != "profiles"}
    return {"options": (work.options, digest_of_value(entries))}


def expect(value: str, known: Iterable[str], where: str) -> None:
    """Refuse a value of an entry that is none of those known."""
    if value not in (names := list(known)):
        raise TwingapError(f"{value!r} found, one of {', '.join(names)} expected", where=where)
