"""Carrier tones of drives: tones fixed in frequency with side lines that turn with the shaft.

mean of whitened spectra in Hz --peaks that neither mains, shaft nor a single state of the bearing explain--> candidates
          records about each --lines at equal distances, in shaft orders; steadiness, sharpness--> the best carrier
records --pairs about a centre without a line (`side_pairs`)--> takes its place where it is certain

A tone has the same level in each record; the power of a sharp mode, which may be as narrow as a bin, varies
exponentially between records. Impacts at one speed produce many lines fixed in Hz, a drive produces a few.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from twingap.effects.drive_interference import CERTAIN_PAIR
from twingap.gap.features.tones.side_pairs import SidePair, strongest_pair
from twingap.gap.features.tones.whitened_spectra import MOST_Z, Mean, Single, Whitened, combined_z
from twingap.records import Array
from twingap.signal.record_transforms import medians

_EACH: Final = ("", "_fs", "_sides", "_balance", "_side_order", "_steady", "_sharp", "_turning")
_BOTH: Final = ("fixed", "carrier")
_PAIR: Final = ("pair", "pair_part", "pair_fs", "pair_side_order", "pair_level")
NAMES: Final = (*(f"{name}{part}" for name in _BOTH for part in _EACH), "fixed_others", "fixed_count", *_PAIR)

_MAINS_TO_HZ: Final = 1300.0
"""Frequency up to which lines on multiples of 50 or 60 Hz count as the mains'; beyond, one bin in seven is on one."""
_MAINS_SHOWN: Final = 3.5
"""z of the mains' harmonics from which all its multiples are excluded; below, only those up to `_FIRST_FEW`."""
_FIRST_FEW: Final = 230.0
"""Frequency, Hz, up to which multiples of the mains are always excluded."""
_LOWEST: Final = 0.06
"""Part of half the sampling rate below which no carrier is sought, as the mains is strong there."""
_HARMONICS: Final = 8
"""Multiples of the mains that are tested for its presence. More include weaker ones."""
_TURNING: Final = 0.6
"""Part of the records with an integer order at a frequency from which a line there counts as the shaft's. A larger
value excludes fewer lines."""
_CARRIERS: Final = 14
"""Strongest lines fixed in Hz that are evaluated as carriers."""
_SIDES: Final = (0.7, 8.6)
"""Distances of side lines, shaft orders."""
_MOST_SIDES: Final = 3000
"""Largest number of trial distances. More are finer and slower."""
_BY_CHANCE: Final = 3.5
"""z of the best of these distances without side lines, which is subtracted."""
_SHOWN: Final = 4.0
"""z from which a line counts as present."""
_UNSTEADY: Final = 6.0
"""Penalty in z of a line whose level scatters like that of noise. A larger value rejects more carriers."""
_SKIRT: Final = 5
"""Least distance of side lines from their carrier, bins."""
_SAME: Final = 2.5
"""Distance within which two lines are one, bins."""


def measure(hz: Mean, records: Sequence[Whitened], deviates: Sequence[Single]) -> dict[str, float]:
    """`NAMES` -> value of records and the `deviates` [bins] of each, `hz` their mean; NaN where no line can be sought.

    Of the strongest fixed line, and of the most probable carrier: z; logarithm of its frequency over the sampling rate;
    z of its side lines together, and of the weaker of both; their distance, orders; spread of the logarithm of its
    level between records; logarithm of its power over the bins beside it; part of the records in which an integer order
    lies there. Then z of the strongest line that is not the carrier's, and the number of such lines.

    Of the strongest pair without a line at its centre: z; part of the records that have it; logarithm of the centre
    over the sampling rate; distance, orders; logarithm of a line's amplitude, unit of the records.
    """
    out = dict.fromkeys(NAMES, math.nan)
    top = 0.5 * min(r.fs_hz for r in records)
    pair = strongest_pair(records)
    if pair is not None:
        values = (pair.z, pair.part, math.log(pair.carrier_hz / (2 * top)), pair.order, pair.level_log)
        out |= dict(zip(_PAIR, values, strict=True))
    z = _unclaimed(hz, records, top)
    if not np.isfinite(z).any():
        return out
    known = np.nan_to_num(z, nan=-9.0)
    peaks = np.flatnonzero((known[1:-1] >= known[:-2]) & (known[1:-1] > known[2:])) + 1
    strongest = peaks[np.argsort(known[peaks])[::-1][:_CARRIERS]]
    if not strongest.size:
        return out
    own, places = known[strongest], hz.places[strongest]
    sides, balance, orders = _beside(records, deviates, places)
    steady, sharp, turning = _nature(records, places)
    joint = np.hypot(np.minimum(own, 2 * MOST_Z), np.maximum(np.nan_to_num(sides) - _BY_CHANCE, 0.0))
    best = int(np.argmax(joint - _UNSTEADY * np.clip(np.nan_to_num(steady), 0.0, 1.0)))
    about = (own, np.log(places / (2 * top)), sides, balance, orders, steady, sharp, turning)
    for name, place in zip(_BOTH, (0, best), strict=True):
        out |= {f"{name}{part}": float(values[place]) for part, values in zip(_EACH, about, strict=True)}
    out["carrier"] = float(joint[best])
    apart = np.abs(places - places[best])
    family = apart < _SAME * hz.step
    for record in records:
        for multiple in (1, 2):
            family |= np.abs(apart - multiple * orders[best] * record.shaft_hz) < _SAME * record.df_hz
    others = own[~family]
    out["fixed_others"] = float(others.max()) if others.size else 0.0
    out["fixed_count"] = float((others > _SHOWN).sum())
    if pair is not None and pair.z > max(CERTAIN_PAIR, float(balance[best])):
        out |= _as_carrier(pair, 2 * top)
    return out


def _as_carrier(pair: SidePair, fs_hz: float) -> dict[str, float]:
    """Features of a carrier without a line: as if it stood out like its side lines."""
    both = math.sqrt(2) * pair.z
    about = (pair.z, math.log(pair.carrier_hz / fs_hz), both, pair.z, pair.order, pair.unsteady, pair.sharp, 0.0)
    joint = math.hypot(min(pair.z, 2 * MOST_Z), both - _BY_CHANCE)
    return {f"carrier{part}": value for part, value in zip(_EACH, about, strict=True)} | {"carrier": joint}


def _unclaimed(hz: Mean, records: Sequence[Whitened], top: float) -> Array:
    """[places] z of lines common to all states of the bearing; NaN at lines of mains and shaft."""
    z = np.where((hz.places > max(65.0, _LOWEST * top)) & (hz.places < top), hz.common, np.nan)
    for mains in (50.0, 60.0):
        shown = combined_z(hz.at(mains * np.arange(1.0, _HARMONICS + 1))) > _MAINS_SHOWN
        off = np.abs(hz.places / mains - np.rint(hz.places / mains)) * mains
        z[(off < _SAME * hz.step) & (hz.places < (_MAINS_TO_HZ if shown else _FIRST_FEW))] = np.nan
    # With records at one speed, the shaft's lines are fixed in Hz too.
    speeds, times = np.unique(np.round([r.shaft_hz for r in records], 2), return_counts=True)
    turning = np.zeros(hz.places.size)
    for shaft_hz, count in zip(speeds, times, strict=True):
        turning += count * (np.abs(hz.places / shaft_hz - np.rint(hz.places / shaft_hz)) * shaft_hz < _SAME * hz.step)
    z[turning > _TURNING * len(records)] = np.nan
    return z


def _beside(records: Sequence[Whitened], deviates: Sequence[Single], places: Array) -> tuple[Array, Array, Array]:
    """[carriers] z of the two lines at the distance where they stand highest, of the weaker one, and that distance."""
    turns = max(record.shaft_hz / record.df_hz for record in records)
    count = int(np.clip(2 * (_SIDES[1] - _SIDES[0]) * turns, 40, _MOST_SIDES))
    orders = np.linspace(*_SIDES, count)
    total, seen = np.zeros((2, places.size, count)), np.zeros((2, places.size, count))
    for record, own in zip(records, deviates, strict=True):
        for side, sign in enumerate((-1, 1)):
            bins = np.rint((places[:, None] + sign * orders * record.shaft_hz) / record.df_hz).astype(int)
            # Nearer, the skirts of a sharp mode are highest.
            inside = (bins > 5) & (bins < own.size - 5) & (orders * record.shaft_hz > _SKIRT * record.df_hz)
            total[side] += np.where(inside, own[np.clip(bins, 0, own.size - 1)], 0.0)
            seen[side] += inside
    both = total.sum(axis=0) / np.sqrt(np.maximum(seen.sum(axis=0), 1))
    both -= medians(both)[:, None]
    best = np.argmax(both, axis=1)
    each = (total / np.sqrt(np.maximum(seen, 1)))[:, np.arange(places.size), best]
    return both[np.arange(places.size), best], each.min(axis=0), orders[best]


def _nature(records: Sequence[Whitened], places: Array) -> tuple[Array, Array, Array]:
    """[carriers] Spread of the log level over records, its excess over bins beside it, part of records with an order
    there."""
    level, above, turning = [], [], []
    for record in records:
        bins = np.rint(places / record.df_hz).astype(int)
        level.append(record.level_logs(bins))
        above.append(record.sharpness(bins))
        order = places / record.shaft_hz
        turning.append(np.abs(order - np.rint(order)) * record.shaft_hz < 1.6 * record.df_hz)
    spread = np.std(level, axis=0) if len(records) > 2 else np.full(places.size, np.nan)
    return spread, np.median(above, axis=0), np.mean(turning, axis=0)
