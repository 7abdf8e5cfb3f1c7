"""Faint harmonics of the shaft: lines at whole orders that all records share, by their fine spectra.

fine power of each record about whole orders, and about orders between --mean over records--> z of each order
    --the first few together--> z of whole orders, and of the best orders between
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.tones.fine_spectra import FineSpectra, Mask
from twingap.gap.features.tones.whitened_spectra import FINE_STEP, Whitened
from twingap.records import Array

_ORDERS: Final = 5
"""Orders that are searched."""
_SLACK: Final = 0.008
"""Relative error of stated speeds. A larger value finds lines at worse speeds, and fewer of the faint ones."""
_BETWEEN: Final = np.concatenate(([0.0], np.arange(0.15, 0.44, 0.035), np.arange(0.56, 0.86, 0.035)))
"""Distances above whole orders, first none: half orders are those of loose parts."""
_TOGETHER: Final = ((1,), (2,), (3,), (1, 2), (1, 2, 3), (1, 2, 3, 4), (2, 3, 4), (3, 4, 5))
"""Orders that a shaft may show."""
_MOST: Final = 9.0
"""Bound of the z of one order, so that a single one is no series."""
_CAGE: Final = 0.004
"""Relative error of a defect's lines, which are left out."""
_TURNS: Final = 10.0
"""Least number of turns in a record. In fewer, there are too few bins between orders."""
_LEAST: Final = 0.3
"""Least part of the records that have to show an order."""

_FEWEST_HALF: Final = 3
"""Smallest number of known half orders from which it is known whether they stand out. A larger value knows it less
often."""


class FaintHarmonics(NamedTuple):
    """Lines at whole orders of the shaft."""

    z: float
    half_z: float  # of the first half orders, likewise; NaN where lines of the mains hide them
    rival_z: float  # of the best orders between whole and half ones
    any_z: float  # of lines that need not be in the records of every state and at every speed
    level_logs: tuple[float, float, float]  # ln of the amplitudes of the first three orders, unit of the records


def strongest(spectra: FineSpectra) -> FaintHarmonics | None:
    """Lines at whole orders of the shaft in a set of records; None where records have too few turns."""
    if min(record.shaft_hz / record.df_hz for record in spectra.records) < _TURNS:
        return None
    between = np.append(_BETWEEN, -0.5)  # half orders, from the first on
    power = np.array([_power(record, between) for record in spectra.records])  # [records, between, orders]
    usual = power[:, 1:-1]
    power -= np.nansum(usual, axis=1, keepdims=True) / np.maximum(np.isfinite(usual).sum(axis=1, keepdims=True), 1)
    number = np.maximum(np.isfinite(usual).sum(axis=(0, 1)), 1)
    spread = np.maximum(np.sqrt(np.nansum(usual**2, axis=(0, 1)) / number), 1e-9)

    def of(kept: Mask) -> tuple[Array, Array]:
        count = np.isfinite(power[kept]).sum(axis=0)
        return np.nansum(power[kept], axis=0) / spread / np.sqrt(np.maximum(count, 1)), count

    *both, count = spectra.shared_z(of)
    known = count > _LEAST * len(spectra.records)
    z, whole = (np.where(known, np.clip(found, -2.0, _MOST), 0.0) for found in both)
    scores, at_most = (
        np.max([found[:, np.array(some) - 1].sum(axis=1) / math.sqrt(len(some)) for some in _TOGETHER], axis=0)
        for found in (z, whole)
    )
    levels = [
        spectra.level_log([_highest(record, order * record.shaft_hz) for record in spectra.records])
        for order in (1, 2, 3)
    ]
    return FaintHarmonics(
        float(scores[0]), float(scores[-1]) if known[-1].sum() >= _FEWEST_HALF else math.nan,
        float(scores[1:-1].max()), float(at_most[0]), (levels[0], levels[1], levels[2]),
    )  # fmt: skip


def _power(record: Whitened, between: Array) -> Array:
    """[between, orders] Highest power about each; NaN at lines of the defect and of the mains."""
    hz = (np.arange(1, _ORDERS + 1) + between[:, None]) * record.shaft_hz
    step_hz = record.df_hz / 2
    width_hz = step_hz + _SLACK * hz
    out = np.full(hz.shape, np.nan)
    known = hz + width_hz < record.fs_hz / 2
    for mains_hz in (50.0, 60.0):
        known &= (np.abs(hz - mains_hz * np.rint(hz / mains_hz)) > 2 * step_hz + width_hz) | (hz < mains_hz / 2)
    if math.isfinite(record.rate_hz):
        own = record.rate_hz * np.rint(hz / record.rate_hz)
        known &= (np.abs(hz - own) > 4 * step_hz + _CAGE * hz) | (own == 0)
    for place in zip(*np.nonzero(known), strict=True):
        out[place] = record.fine[_near(record, float(hz[place]))].max() * FINE_STEP
    return out


def _near(record: Whitened, hz: float) -> NDArray[np.int64]:
    """Fine bins in which a line at this frequency may be."""
    step_hz = record.df_hz / 2
    width = 1 + _SLACK * hz / step_hz
    low, high = round(hz / step_hz - width), round(hz / step_hz + width)
    return np.arange(max(low, 0), min(high, record.fine.size - 1) + 1)


def _highest(record: Whitened, hz: float) -> NDArray[np.int64]:
    """[1] The fine bin with the highest power about this frequency."""
    near = _near(record, hz)
    return near[[int(np.argmax(record.fine[near]))]]
