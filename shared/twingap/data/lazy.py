"""Loaders of samples on access, as picklable classes for worker processes."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from twingap.records import Array

T = TypeVar("T")


@dataclass(frozen=True)
class Each:
    """Loader of record i by the i-th of several callables.

    Parameters
    ----------
    loads : tuple of callable, () -> Array [samples]
    """

    loads: tuple[Callable[[], Array], ...]

    def __call__(self, index: int) -> Array:
        return self.loads[index]()


class Latest(Generic[T]):
    """Cache of the last result of a read function, so that memory is bounded by one file.

    Parameters
    ----------
    read : callable, key -> T
    """

    def __init__(self, read: Callable[..., T]) -> None:
        self._read = read
        self._held: tuple[Hashable, T] | None = None

    def __call__(self, *key: Hashable) -> T:
        """`read(*key)`, or the cached result if the last call had the same key."""
        held = self._held  # one assignment: concurrent threads may read twice but never mix results
        if held is None or held[0] != key:
            held = (key, self._read(*key))
            self._held = held
        return held[1]

    def __getstate__(self) -> dict[str, Any]:
        return {"_read": self._read, "_held": None}  # samples are not pickled
