"""Samples read when asked for, in a form that worker processes can be sent: classes, since closures cannot be."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from twingap.records import Array

T = TypeVar("T")


@dataclass(frozen=True)
class Each:
    """Gives the samples of record i by calling the i-th of these.

    Parameters
    ----------
    loads : tuple of callable, () -> Array
    """

    loads: tuple[Callable[[], Array], ...]

    def __call__(self, index: int) -> Array:
        return self.loads[index]()


class Latest(Generic[T]):
    """Remembers what was read last, so that memory stays bounded by one file while neighbours ask for the same one.

    Parameters
    ----------
    read : callable, key -> T
    """

    def __init__(self, read: Callable[..., T]) -> None:
        self._read = read
        self._held: tuple[Hashable, T] | None = None

    def __call__(self, *key: Hashable) -> T:
        """`read(*key)`, or what it returned the last time if that was for the same key."""
        held = self._held  # one assignment, so that threads may at worst read twice
        if held is None or held[0] != key:
            held = (key, self._read(*key))
            self._held = held
        return held[1]

    def __getstate__(self) -> dict[str, Any]:
        return {"_read": self._read, "_held": None}  # a copy for another process need not carry the samples
