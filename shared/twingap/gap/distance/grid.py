"""Common bins of all records that are to be compared: frequencies, orders, parts of the record.

conditions of the records, bearing --Grid.of--> edges of bins, the same for measured and simulated records
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.records import Array, Condition

FEWEST_SAMPLES: Final = 64
"""Smallest number of samples of a record. Fewer give no usable spectrum."""
SEGMENTS: Final = 16
"""Equal parts of a record in the domain "time": more resolve shorter changes, each with more noise."""
_LEVELS: Final = 40
"""Bands of the smooth spectrum: more resolve sharper modes, each with more noise."""


@dataclass(frozen=True)
class Axis:
    """Bins of one domain."""

    lo: Array  # [bins] bounds of each, in `unit`
    hi: Array
    # [bins] Quantity of each bin ("level", "lines", ...); bins of one kind are in ascending order.
    kind: tuple[str, ...]
    unit: str

    @cached_property
    def weight(self) -> Array:
        """[bins] Weight of each bin in its domain: equal for kinds, and for bins within a kind; the sum is 1."""
        kinds = np.array(self.kind)
        names, counts = np.unique(kinds, return_counts=True)
        share = {name: 1 / (count * names.size) for name, count in zip(names, counts, strict=True)}
        return np.array([share[kind] for kind in self.kind])


@dataclass(frozen=True)
class Grid:
    """Common bins of all records that are to be compared.

    Notes
    -----
    Frequencies: 40 equal bands for the level between the lines; for the lines, bands of 10 Hz up to 500 Hz and of 4 %
    above. Orders: steps of a quarter, so that half orders have separate bins; integer orders above 40. Envelope
    orders: steps of a tenth, which separate the cage's sidebands from the shaft's.
    """

    top_hz: float  # half the smallest sampling rate
    # Highest shaft order below half the sampling rate of every record, and highest order of envelope spectra.
    top_order: float
    top_envelope_order: float
    duration_s: float  # median duration of the records, s; the axis of the domain "time"

    @classmethod
    def of(cls, conditions: Sequence[Condition], bearing: Bearing) -> Grid:
        """For these records of this bearing. Real and simulated records must be measured on one and the same grid.

        Raises
        ------
        TwingapError
            For no records, or one of fewer than 64 samples.
        """
        if not conditions:
            raise TwingapError("no records to measure", where="feature vectors")
        for condition in conditions:
            require_length(condition.n_samples, condition.name)
        orders = min(condition.fs_hz / 2 / (condition.speed_rpm / 60) for condition in conditions)
        return cls(
            top_hz=min(condition.fs_hz for condition in conditions) / 2,
            top_order=float(np.floor(min(orders * 0.98, 80.0))),
            top_envelope_order=float(np.ceil(min(2.2 * bearing.bpfi + 1, 30.0))),
            duration_s=float(np.median([condition.duration_s for condition in conditions])),
        )

    @cached_property
    def levels_hz(self) -> Array:
        """Edges of the bands of the smooth level, Hz."""
        return np.linspace(0, self.top_hz, _LEVELS + 1)

    @cached_property
    def lines_hz(self) -> Array:
        """Edges of the bands of the lines, Hz."""
        low = np.arange(5.0, min(505.0, self.top_hz + 1e-9), 10.0)
        count = int(np.ceil(np.log(self.top_hz / low[-1]) / 0.04)) if self.top_hz > low[-1] * 1.04 else 0
        high = np.geomspace(low[-1], self.top_hz, count + 1)[1:] if count else np.empty(0)
        return np.concatenate((low, high)) if low.size + high.size > 1 else np.array([0.0, self.top_hz])

    @cached_property
    def orders(self) -> Array:
        """Edges of the bands of shaft orders, centred on quarters (integers above 40)."""
        fine = np.arange(0.375, min(40.0, max(self.top_order, 1.0)) + 0.2, 0.25)
        coarse = np.arange(41.5, self.top_order + 0.6, 1.0) if self.top_order > 41 else np.empty(0)
        return np.concatenate((fine, coarse))

    @cached_property
    def envelope_orders(self) -> Array:
        """Edges of the bands of envelope orders, centred on tenths."""
        return np.arange(0.15, self.top_envelope_order + 0.06, 0.1)

    @cached_property
    def envelope_floor(self) -> Array:
        """Edges of the bands of the floor of the envelope spectrum, orders."""
        return np.linspace(0.15, self.top_envelope_order, 9)


def require_length(samples: int, name: str) -> None:
    """Raise TwingapError for a record of fewer than 64 samples."""
    if samples < FEWEST_SAMPLES:
        raise TwingapError(
            f"has {samples} samples, at least {FEWEST_SAMPLES} expected", where=f"record {name!r}", mend="leave it out"
        )
