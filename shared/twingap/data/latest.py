"""One value kept: what was read last, for neighbours that ask for the same file."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """Remembers the last result of `read`, so that memory stays bounded by one file.

    Parameters
    ----------
    read : callable, key -> T
    """

    def __init__(self, read: Callable[[Any], T]) -> None:
        self._read = read
        self._held: tuple[Hashable, T] | None = None

    def __call__(self, key: Hashable) -> T:
        """`read(key)`, or what it returned the last time if that was for the same key."""
        held = self._held  # one assignment, so that threads may at worst read twice
        if held is None or held[0] != key:
            held = (key, self._read(key))
            self._held = held
        return held[1]

    def __getstate__(self) -> dict[str, Any]:
        return {"_read": self._read, "_held": None}  # a copy for another process need not carry the samples
