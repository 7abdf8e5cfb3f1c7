"""Independent random streams, one per record and purpose.

Every record, and within it every effect, draws from a stream of its own that depends only on the root entropy, the
record's place and the purpose's name. So the same seed gives the same bytes on any number of cores, a record does not
change when others are left out, and adding an effect does not disturb what the others draw: two chains that differ by
one effect are simulated with common random numbers.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np


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
        The record's place in the run, from 0.
    """

    root: int
    index: int

    def __call__(self, purpose: str) -> np.random.Generator:
        """Generator for `purpose` (an effect's name, say); always in its initial state."""
        key = (self.index, zlib.crc32(purpose.encode()))
        return np.random.Generator(np.random.SFC64(np.random.SeedSequence(self.root, spawn_key=key)))
