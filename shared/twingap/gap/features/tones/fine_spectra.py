"""Fine spectra of a set of records, for lines that all records share and that are faint in each.

Whitened of each record --thinned, one frequency axis--> FineSpectra --sum over records, also without each group--> z

A line of a supply or of the shaft is in the records of every state of the bearing and at every speed. Lines of impacts
and of gears that add up by chance are in those of one state or of one speed: z falls where these are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from twingap.gap.features.tones.whitened_spectra import FINE_STEP, NOISE, Fine, Whitened
from twingap.records import Array

Mask = NDArray[np.bool_]

_MOST_BINS: Final = 4_000_000
"""Bins of all records together that are searched. More find fainter lines and take longer."""
_FEWEST: Final = 10
"""Smallest number of records. Fewer have lines by chance."""
_SHARE: Final = 1.7
"""Bound of z over that without a group of records. A larger value lets lines count that are strong in one group."""
_BESIDE: Final = (6, 26)
"""Distances from a line, bins, at which there is nothing of it and all of a mode."""


class FineSpectra(NamedTuple):
    """Fine spectra of records on one axis."""

    records: Sequence[Whitened]
    step_hz: float
    groups: Sequence[Mask]  # [records] records of each state, of the slower and of the faster half

    @classmethod
    def of(cls, records: Sequence[Whitened]) -> FineSpectra | None:
        """Evenly spaced records with at most `_MOST_BINS` together; None where there are too few."""
        if len(records) < _FEWEST:
            return None
        most = max(int(_MOST_BINS / max(record.fine.size for record in records)), _FEWEST)
        kept = np.unique(np.linspace(0, len(records) - 1, min(most, len(records))).round().astype(int))
        used = [records[k] for k in kept]
        return cls(used, min(record.df_hz for record in used) / 2, _groups(used))

    @property
    def speeds_hz(self) -> Array:
        """[records] Shaft rates."""
        return np.array([record.shaft_hz for record in self.records])

    def powers(self, low_hz: float, high_hz: float) -> Fine:
        """[records, bins] `Whitened.fine` between two frequencies."""
        places_hz = np.asarray(
            np.arange(round(low_hz / self.step_hz), round(high_hz / self.step_hz)) * self.step_hz, float
        )
        return np.stack([_read(record, places_hz) for record in self.records])

    def shared_z(self, z_of: Callable[[Mask], tuple[Array, Array]]) -> tuple[Array, Array, Array]:
        """z of lines in all records together, less where it falls when a group is left out; z as it is; and numbers of
        records.

        `z_of` gives z and the number of records that it is from, for some of the records [records].
        """
        whole, count = z_of(np.ones(len(self.records), bool))
        z = whole
        for group in self.groups:
            rest, kept = z_of(~group)
            z = np.minimum(z, _SHARE * rest * np.sqrt(count / np.maximum(kept, 1)))
        return z, whole, count

    def level_log(self, bins: Sequence[NDArray[np.int64]]) -> float:
        """ln of the amplitude of a line in these fine bins of each record, unit of the records."""
        floors = [math.log(NOISE) + record.floor_at(at // 2) for record, at in zip(self.records, bins, strict=True)]
        noise = np.exp(np.array(floors))
        over = np.array([record.fine[at] * FINE_STEP for record, at in zip(self.records, bins, strict=True)]) - 1
        power = (over / noise).sum() / (1 / noise**2).sum()  # least squares with the variance of noise
        return 0.5 * math.log(2 * max(float(power), 1e-3 * float(noise.min())))


def _read(record: Whitened, places_hz: Array) -> Fine:
    """[places] Fine power of one record at the bins nearest to these frequencies."""
    power: Fine = record.fine[np.minimum(np.rint(2 * places_hz / record.df_hz).astype(int), record.fine.size - 1)]
    return power


def _groups(records: Sequence[Whitened]) -> list[Mask]:
    """Groups of records that are left out in turn."""
    kinds, speeds = np.array([record.kind for record in records]), np.array([record.shaft_hz for record in records])
    slow = speeds < np.median(speeds) if speeds.max() == np.median(speeds) else speeds <= np.median(speeds)
    of_kind = [kinds == kind for kind in sorted(set(kinds))]
    return [group for group in (*of_kind, slow, ~slow) if group.any() and not group.all()]


def above_both_sides(total: Array) -> Array:
    """[bins] A sum over records, over the higher of its medians on both sides, which a sharp mode does not exceed."""
    near, far = _BESIDE
    running = median_filter(np.pad(total, far, mode="edge"), size=far - near + 1, mode="nearest")
    at, middle = far + np.arange(total.size), (near + far) // 2
    return np.asarray(total / np.maximum(np.maximum(running[at - middle], running[at + middle]), 1e-9))
