"""Side lines of a carrier: a frequency fixed in Hz with two lines at a whole number of shaft orders, faint in a record.

fine power of each record --highest sum of both sides, symmetric within the error of the speed--> sum over records --> z
                          --power at the centre, sum over records--> z of the carrier's own line

Impacts of another bearing have many lines, and with them many such carriers by chance; a drive has one, which exceeds
all others.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.tones.fine_spectra import FineSpectra, Mask, above_both_sides
from twingap.gap.features.tones.whitened_spectra import Fine, Whitened
from twingap.records import Array
from twingap.signal.record_transforms import medians

_ORDERS: Final = range(1, 9)
"""Distances of the lines from their carrier, shaft orders."""
_SLACK: Final = 0.02
"""Relative error of these distances: that of the stated speed, or the slip of a motor. A larger value finds lines at
worse speeds, and takes more lines by chance."""
_LOWEST: Final = 0.05
"""Lowest carrier, part of the sampling rate: below, mains and shaft have many lines."""
_OWN: Final = 5.0
"""Bound of the z of the carrier's own line. With a larger one, other lines that are fixed in Hz count as carriers."""
_FEWEST_BINS: Final = 400
"""Smallest number of possible carriers. With fewer, z is not known."""
_LEAST_SPREAD: Final = 0.01
"""Smallest relative spread of noise in a sum over records. A larger value takes fewer lines in constant records."""
_APART: Final = 24
"""Distance from which two carriers are different ones, bins."""
_SPEEDS: Final = 1.03
"""Least ratio of the highest to the lowest speed. With less, lines of a gear are fixed too."""


class SideLines(NamedTuple):
    """The carrier whose side lines stand out most."""

    carrier_hz: float
    order: float  # distance of its side lines, shaft orders
    z: float  # of side lines and carrier together, in which a strong carrier counts little without side lines
    rival_z: float  # of the best other carrier
    own_z: float  # of a line at the carrier itself
    level_log: float  # ln of the amplitude of a side line, unit of the records
    own_level_log: float  # ln of the amplitude at the carrier


def strongest(spectra: FineSpectra) -> SideLines | None:
    """The carrier with the most significant side lines; None where records are short, or all at one speed."""
    speeds, step_hz = spectra.speeds_hz, spectra.step_hz
    if speeds.max() < _SPEEDS * speeds.min():
        return None
    top = int(min(record.fs_hz for record in spectra.records) / 2 / step_hz)
    reach = int((_ORDERS[-1] + 1) * speeds.max() / step_hz)
    low, high = max(int(2 * _LOWEST * top), reach), top - reach
    if high - low < _FEWEST_BINS:
        return None
    powers = spectra.powers(0.0, top * step_hz)
    own = _z(spectra, powers[:, low:high])
    best, highest = (-math.inf, 0, 0), np.zeros(high - low)
    for order in _ORDERS:
        distances = order * speeds / step_hz
        both = [_both(power, low, high, distance) for power, distance in zip(powers, distances, strict=True)]
        joint = np.hypot(_z(spectra, np.stack(both)).clip(0.0), own.clip(0.0, _OWN))
        np.maximum(highest, joint, out=highest)
        place = int(np.argmax(joint))
        best = max(best, (float(joint[place]), order, place))
    z, order, place = best
    carrier_hz = (low + place) * step_hz
    highest[max(place - _APART, 0) : place + _APART + 1] = 0.0
    return SideLines(
        carrier_hz, float(order), z, float(highest.max()), float(own[place]),
        spectra.level_log([_side_bins(record, carrier_hz, order) for record in spectra.records]),
        spectra.level_log([np.array([round(2 * carrier_hz / record.df_hz)]) for record in spectra.records]),
    )  # fmt: skip


def _both(power: Fine, low: int, high: int, distance: float) -> Fine:
    """[high - low] Highest sum of the power at both sides of each bin, at the same distance."""
    highest = np.zeros(high - low, np.uint8)
    for off in _offsets(distance):
        np.maximum(highest, power[low - off : high - off] + power[low + off : high + off], out=highest)
    return highest


def _offsets(distance: float) -> range:
    """Distances of side lines, bins, where speeds have errors."""
    slack = 1 + round(_SLACK * distance)
    return range(round(distance) - slack, round(distance) + slack + 1)


def _side_bins(record: Whitened, carrier_hz: float, order: int) -> NDArray[np.int64]:
    """[2] Fine bins of both side lines in one record: where their sum is highest."""
    at = round(2 * carrier_hz / record.df_hz)
    off = np.array(_offsets(2 * order * record.shaft_hz / record.df_hz))
    off = off[(at - off >= 0) & (at + off < record.fine.size)]
    best = int(off[np.argmax(record.fine[at - off].astype(int) + record.fine[at + off])])
    return np.array([at - best, at + best])


def _z(spectra: FineSpectra, values: NDArray[np.uint8]) -> Array:
    """[bins] z of the sum over records [records, bins]."""

    def of(kept: Mask) -> tuple[Array, Array]:
        above = above_both_sides(values[kept].sum(axis=0, dtype=np.float32))
        usual = float(medians(above))
        spread = 1.4826 * float(medians(np.abs(above - usual)))
        return (above - usual) / max(spread, _LEAST_SPREAD), np.asarray(kept.sum())

    return spectra.shared_z(of)[0]
