"""Configurations, and checks of what the types of their entries cannot say."""

from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from twingap import TwingapError
from twingap.config import build, read_toml

T = TypeVar("T")


def read(kind: type[T], path: Path) -> T:
    """Read a configuration; errors name file, key, value and what was expected."""
    return build(kind, read_toml(path), path)


def expect(value: str, known: Iterable[str], where: str) -> None:
    """Refuse a value of an entry that is none of those known."""
    if value not in (names := list(known)):
        raise TwingapError(f"{value!r} found, one of {', '.join(names)} expected", where=where)
