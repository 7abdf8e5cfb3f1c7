"""Configurations that other studies read too, and checks of what the types of their entries cannot say."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from twingap import TwingapError
from twingap.config import build, read_toml

T = TypeVar("T")


def read(kind: type[T], check: Callable[[T, Path], None], path: Path) -> T:
    """Read and check a configuration; errors name file, key, value and what was expected."""
    options = build(kind, read_toml(path), path)
    check(options, path)
    return options


def expect(value: str, known: Iterable[str], where: str) -> None:
    """Refuse a value of an entry that is none of those known."""
    if value not in (names := list(known)):
        raise TwingapError(f"{value!r} found, one of {', '.join(names)} expected", where=where)
