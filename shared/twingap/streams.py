"""Independent random streams, one per record and purpose.

Every record, and within it every effect, has its own stream, which depends only on the root entropy, the record's
index and the name of the purpose. The same seed therefore gives the same bytes on any number of cores, a record does
not change when others are left out, and adding an effect does not change the random numbers of others: two chains that
differ by one effect are simulated with common random numbers.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_KEPT_SAMPLES: Final = 65536
"""Longest noise of a record that is kept. A larger value takes more memory: up to 128 records are kept."""


def root_entropy(rng: np.random.Generator) -> int:
    """Draw 128 bits from `rng`, from which any number of streams can be derived."""
    high, low = rng.integers(0, 2**63, size=2, dtype=np.int64)
    return (int(high) << 64) | int(low)


@dataclass(frozen=True)
class Streams:
    """The random streams of one record.

    Parameters
    ----------
    root : int
        Entropy shared by all records of a run, from `root_entropy`.
    index : int
        Index of the record in the run, from 0.
    """

    root: int
    index: int

    def __call__(self, purpose: str) -> np.random.Generator:
        """Generator for `purpose` (such as an effect's name), always in its initial state."""
        return np.random.Generator(np.random.SFC64(_seed(self.root, self.index, purpose)))

    def normal(self, purpose: str, size: int) -> tuple[NDArray[np.float64], np.random.Generator]:
        """The first `size` standard normal numbers of a stream, and its generator after them."""
        rng = self(purpose)
        return rng.standard_normal(size), rng


class KeptStreams(Streams):
    """Streams whose noise is kept, for a search that simulates the same records hundreds of times."""

    def normal(self, purpose: str, size: int) -> tuple[NDArray[np.float64], np.random.Generator]:
        """The first `size` standard normal numbers of a stream, read-only, and its generator after them."""
        rng = self(purpose)
        if size > _KEPT_SAMPLES:
            return rng.standard_normal(size), rng
        numbers, state = _normal(self.root, self.index, purpose, size)
        rng.bit_generator.state = state
        return numbers, rng


class _Seed(np.random.SeedSequence):
    """Seed sequence that mixes its entropy once: a search simulates the same records hundreds of times."""

    _words: NDArray[Any] | None = None

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> NDArray[Any]:
        """Words for the initial state of a generator, always of the same type."""
        if self._words is None:
            self._words = super().generate_state(n_words, dtype)
        return self._words


@lru_cache(maxsize=4096)
def _seed(root: int, index: int, purpose: str) -> _Seed:
    return _Seed(root, spawn_key=(index, zlib.crc32(purpose.encode())))


@lru_cache(maxsize=128)
def _normal(root: int, index: int, purpose: str, size: int) -> tuple[NDArray[np.float64], Mapping[str, Any]]:
    """Normal numbers of a stream, and the state of its generator after them."""
    rng = Streams(root, index)(purpose)
    numbers = rng.standard_normal(size)
    numbers.flags.writeable = False
    return numbers, rng.bit_generator.state
