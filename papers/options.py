"""Checks of what the types of a configuration's entries cannot say, and configurations that other studies read too."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from twingap import TwingapError
from twingap.config import build, read_toml
from twingap.provenance import digest_of_value, plain

T = TypeVar("T")


def read(kind: type[T], path: Path) -> T:
    """Read a configuration; errors name file, key, value and what was expected."""
    return build(kind, read_toml(path), path)


def as_input(options: Any) -> dict[str, tuple[Any, str]]:
    """A configuration as an input of jobs, whose keys then depend on all of it but the profiles."""
    return {"options": (options, digest_of_value({k: v for k, v in plain(options).items() if k != "profiles"}))}


def expect(value: str, known: Iterable[str], where: str) -> None:
    """Refuse a value of an entry that is none of those known."""
    if value not in (names := list(known)):
        raise TwingapError(f"{value!r} found, one of {', '.join(names)} expected", where=where)
