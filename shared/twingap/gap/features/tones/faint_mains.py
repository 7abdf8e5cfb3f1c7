"""Faint hum of the mains: lines at multiples of 50 or 60 Hz that all records share, by their fine spectra.

fine power of each record without orders of the shaft (of a loose part, half ones too) and lines of its defect
    --sum over records--> z of every frequency
    --multiples of 50 and 60 Hz, and of other frequencies--> z of the mains, and of the best rival
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from twingap.gap.features.tones.fine_spectra import FineSpectra, Mask, above_both_sides
from twingap.gap.features.tones.whitened_spectra import FINE_STEP, Whitened
from twingap.records import Array
from twingap.signal.record_transforms import medians

_TOP_HZ: Final = 400.0
"""End of the frequencies that are searched."""
_HARMONICS: Final = ((1,), (2,), (3,), (1, 2, 3), (1, 3, 5), (1, 2, 3, 4, 5), (2, 4, 6))
"""Harmonics that a hum may have."""
_MOST: Final = 9.0
"""Bound of the z of one line, so that a single one is no series."""
_RIVALS: Final = np.concatenate((np.arange(43.3, 49.0, 0.9), np.arange(51.2, 59.0, 0.9), np.arange(61.2, 67.0, 0.9)))
"""Frequencies, Hz, of which no supply has multiples."""
_SPREAD: Final = 0.94
"""Standard deviation of the capped power of noise in one record, over its mean."""
_FLOOR: Final = 0.7
"""Least mean power over that of noise that a line is compared with, where most of the records are left out."""
_TURNING: Final = 0.006
"""Relative error of shaft orders that are left out. A larger value leaves less of the spectrum."""
_CAGE: Final = 0.004
"""The same of a defect's lines."""
_WIDEST_HZ: Final = 2.0
"""Largest width of a bin, Hz. With wider ones, too few lie between the multiples of the mains and of the shaft."""
_LEAST: Final = 0.3
"""Least part of the records that have to show a frequency."""


class FaintMains(NamedTuple):
    """The hum of the mains that stands out more: 50 or 60 Hz."""

    mains_hz: float
    z: float
    rival_z: float  # of the best series of another frequency
    level_log: float  # ln of the amplitude of the first harmonic, unit of the records


def strongest(spectra: FineSpectra, half_orders: bool = True) -> FaintMains | None:
    """The hum of the mains in a set of records; None where records are short.

    Half orders of the shaft, which a loose part has, are left out too with `half_orders`: much of the spectrum.
    """
    if max(record.df_hz for record in spectra.records) > _WIDEST_HZ:
        return None
    step_hz = spectra.step_hz
    top = int(min(_TOP_HZ, 0.5 * min(record.fs_hz for record in spectra.records)) / step_hz)
    weight = np.array([_without_turning(record, step_hz, top, 2 if half_orders else 1) for record in spectra.records])
    power = spectra.powers(0.0, top * step_hz) * np.float32(FINE_STEP) * weight

    def of(kept: Mask) -> tuple[Array, Array]:
        count = weight[kept].sum(axis=0)
        mean = power[kept].sum(axis=0) / np.maximum(count, 1)
        return (above_both_sides(np.maximum(mean, _FLOOR)) - 1) * np.sqrt(count) / _SPREAD, count

    z, _, count = spectra.shared_z(of)
    z[count < _LEAST * len(spectra.records)] = 0.0
    z /= max(1.4826 * float(medians(np.abs(z - medians(z)))), 1.0)
    scores = [_score(z, mains_hz / step_hz) for mains_hz in (50.0, 60.0)]
    mains_hz = (50.0, 60.0)[int(np.argmax(scores))]
    for multiple in range(1, int(_TOP_HZ / mains_hz)):
        at = round(multiple * mains_hz / step_hz)
        z[max(at - 4, 0) : at + 5] = 0.0
    first = [np.array([round(2 * mains_hz / record.df_hz)]) for record in spectra.records]
    return FaintMains(
        mains_hz, max(scores), max(_score(z, base / step_hz) for base in _RIVALS), spectra.level_log(first)
    )


def _without_turning(record: Whitened, step_hz: float, top: int, per_order: int) -> Array:
    """[top] 0 at multiples of this part of the shaft rate and at lines of the defect, else 1."""
    kept, step = np.ones(top), record.shaft_hz / per_order / step_hz
    shaft = np.arange(1, top / step + 1) * step
    _leave_out(kept, shaft, 2.5 + _TURNING * shaft)
    if math.isfinite(record.rate_hz):
        own = np.arange(1, top * step_hz / record.rate_hz + 1) * record.rate_hz / step_hz
        _leave_out(kept, own, 4.0 + _CAGE * own)
    return kept


def _leave_out(kept: Array, places: Array, widths: Array) -> None:
    for place, width in zip(places, widths, strict=True):
        kept[max(int(place - width), 0) : int(place + width) + 2] = 0.0


def _score(z: Array, base: float) -> float:
    """z of the best series of harmonics of `base`, bins."""
    at = np.rint(base * np.arange(1, 7)).astype(int)
    near = maximum_filter1d(z, 3)
    lines = np.where(at < z.size - 1, np.clip(near[np.minimum(at, z.size - 1)], -2.0, _MOST), np.nan)
    best = 0.0
    for harmonics in _HARMONICS:
        known = lines[np.array(harmonics) - 1]
        known = known[np.isfinite(known)]
        if known.size:
            best = max(best, float(known.sum() / math.sqrt(known.size)))
    return best
