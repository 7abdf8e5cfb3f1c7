"""Spectra of a set of records over their floors, and their means in Hz and in shaft orders.

record --periodogram over its floor, logarithm--> Whitened --mean over records, in Hz and in orders--> z of every place

A line far below the noise of one record is significant in the mean of many. Lines fixed in Hz (mains, a carrier) add up
in the mean over Hz, lines of the shaft in the mean over orders. Power of noise is gamma distributed, and its cube root
nearly normal (Wilson and Hilferty 1931, doi:10.1073/pnas.17.12.684): z is comparable between one record and a hundred,
and z of several lines can be combined (Stouffer).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.impacts.impulse_response import impact_rate_hz
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, local_floor, medians

Single = NDArray[np.float32]
Half = NDArray[np.float16]
Fine = NDArray[np.uint8]

NOISE: Final = 1 / math.log(2)
"""Mean power of noise over its median."""
SPREAD: Final = 0.258
"""Standard deviation of the cube root of smoothed noise power over its median, of one record (Hann, 1/4 1/2 1/4)."""
MOST_Z: Final = 12.0
"""Bound of a line's z in its comb. With a larger one, a single line is taken for a comb."""
_CAP: Final = 9.0
"""Excess at which one record's line is capped, so that the loudest record does not dominate the mean."""
FINE_STEP: Final = 0.05
"""Resolution of `Whitened.fine`."""
_FINE_CAP: Final = 4.0
"""Its cap, so that a few strong lines, of which two may be at any distance, do not add up like a faint line in each
record. A larger value takes more strong lines by chance."""
_ENVELOPE_CAP: Final = 40.0
"""The same of envelopes; higher, since the decay of their harmonics is needed."""
_LEAST_DEVIATE: Final = -2.0
_MOST_DEVIATE: Final = 6.0
"""Bounds of one record's deviate on a comb that is sought record by record."""
_ABOUT: Final = 45
"""Bins about a line that its floor is taken from: fewer follow sharp modes, more are steadier."""
_TOP_ORDER: Final = 125.0
"""End of the order axis."""
_STEP: Final = 0.01
"""Of the order axis, unless a record resolves more: one of a second at ten turns resolves a tenth."""
_NEAR: Final = np.arange(4, 10)
"""Bins from a line that hold nothing of the line, and all of a mode."""
_BESIDE: Final = np.array([-6, -5, -4, 4, 5, 6])
"""Bins beside a line for its sharpness; closer bins contain the skirts of the line."""
_FLOOR_STEP: Final = 8
"""Bins between stored values of the floor."""
_WIDE: Final = 0.22
"""Part of a comb's spacing up to which smeared lines are masked; beyond, lines and gaps cannot be separated."""


class Whitened(NamedTuple):
    """Spectra of one record over their floors, for means over many records."""

    logs: Half  # [bins] ln of the periodogram over its floor, smoothed over three bins
    floor_logs: Single  # [bins / _FLOOR_STEP] ln of the floor, unit^2
    df_hz: float
    envelope: Single  # [bins] periodogram of the broadband squared envelope over its floor, smoothed, capped
    envelope_df_hz: float
    shaft_hz: float
    fs_hz: float
    kind: str  # state of the bearing: lines of impacts are in the records of one state alone
    rate_hz: float  # impacts per second; NaN without a defect
    fine: Fine  # [2 bins] power at twice as many bins over that of noise, in `FINE_STEP`, capped; 1 on a defect's comb

    def power(self) -> Single:
        """[bins] Power over its floor, capped; lines of the defect's own comb are replaced by noise."""
        out = np.minimum(np.exp(self.logs.astype(np.float32)), np.float32(_CAP))
        if math.isfinite(self.rate_hz):
            at = self._own_comb()
            for place, reach in zip(at, 3 + 0.004 * at, strict=True):  # cages slip
                out[max(int(place - reach), 0) : int(place + reach) + 2] = NOISE
        return out

    def deviates(self) -> Single:
        """[bins] Normal deviates of the power where there is noise, capped; 0 on a defect's own comb, as far as its
        lines are separate from the gaps between them."""
        root = np.exp(self.logs.astype(np.float32) / 3)
        out = np.asarray(np.clip((root - math.cbrt(NOISE)) / SPREAD, _LEAST_DEVIATE, _MOST_DEVIATE), np.float32)
        if math.isfinite(self.rate_hz):
            at = self._own_comb()
            for place, reach in zip(at, 2.5 + 0.0015 * at, strict=True):
                if reach > _WIDE * at[0]:
                    break
                out[max(int(place - reach), 0) : int(place + reach) + 2] = 0.0
        return out

    def bins_of(self, places_hz: Array) -> NDArray[np.int64]:
        """[...] Nearest bins of these frequencies."""
        return np.clip(np.rint(places_hz / self.df_hz).astype(np.int64), 0, self.logs.size - 1)

    def level_logs(self, bins: NDArray[np.int64]) -> Array:
        """[...] ln of the highest power within a bin of each, unit^2."""
        near = np.clip(bins[..., None] + np.arange(-1, 2), 0, self.logs.size - 1)
        highest: Array = self.logs[near].astype(np.float64).max(axis=-1)
        return np.asarray(highest + self.floor_at(bins), dtype=np.float64)

    def floor_at(self, bins: NDArray[np.int64]) -> Array:
        """[...] ln of the floor, unit^2."""
        return np.interp(bins, np.arange(self.floor_logs.size) * _FLOOR_STEP, self.floor_logs)

    def sharpness(self, bins: NDArray[np.int64]) -> Array:
        """[...] ln of the highest power within a bin of each, over the mean of bins beside it."""
        near = self.logs[np.clip(bins[..., None] + np.arange(-1, 2), 0, self.logs.size - 1)].astype(float)
        beside = self.logs[np.clip(bins[..., None] + _BESIDE, 0, self.logs.size - 1)].astype(float)
        return np.asarray(near.max(axis=-1) - np.log(np.exp(beside).mean(axis=-1)), dtype=np.float64)

    def _own_comb(self) -> Array:
        """[lines] Bins of a defect's comb."""
        return np.asarray(np.arange(1, int(0.5 * self.fs_hz / self.rate_hz) + 1) * self.rate_hz / self.df_hz, float)


def whiten(record: RecordTransforms) -> Whitened:
    """Whitened spectra of one record."""
    envelope = record.envelope_in(0.02 * record.fs_hz, 0.48 * record.fs_hz)
    top = min(envelope.spectrum.size, round(45 * record.shaft_hz / envelope.df_hz) + 60)
    floor = np.maximum(local_floor(record.tones), 1e-300)
    rate_hz = math.nan if record.fault_order is None else impact_rate_hz(record)
    spectrum = envelope.spectrum[:top]
    white = np.minimum(_smooth(spectrum / np.maximum(local_floor(spectrum), 1e-300)), _ENVELOPE_CAP)
    return Whitened(
        np.log(np.clip(_smooth(record.tones / floor), 1e-4, 1e25)).astype(np.float16),
        np.log(floor[::_FLOOR_STEP]).astype(np.float32), record.df_hz, white.astype(np.float32), envelope.df_hz,
        record.shaft_hz, record.fs_hz, str(record.condition.fault), rate_hz, _fine(record, floor, rate_hz),
    )  # fmt: skip


def _fine(record: RecordTransforms, floor: Array, rate_hz: float) -> Fine:
    """[2 bins] `Whitened.fine`. Twice as many bins, as a line between two bins loses power."""
    over = np.empty(2 * floor.size)
    over[0::2], over[1::2] = record.tones, record.tones_between()
    over /= NOISE * np.repeat(floor, 2)
    over[:6] = 1.0
    fine = np.rint(np.minimum(over, _FINE_CAP) / FINE_STEP).astype(np.uint8)
    if math.isfinite(rate_hz):
        at = np.arange(1, int(0.5 * record.fs_hz / rate_hz) + 1) * rate_hz * 2 / record.df_hz
        for place, reach in zip(at, 6 + 0.004 * at, strict=True):  # cages slip
            fine[max(int(place - reach), 0) : int(place + reach) + 2] = round(1 / FINE_STEP)
    return fine


def _smooth(over: Array) -> Array:
    """Smoothed over three bins: a line between two bins is in both, and a small speed error moves it by one."""
    over[:3] = NOISE
    smooth = over.copy()
    smooth[1:-1] = 0.5 * over[1:-1] + 0.25 * (over[:-2] + over[2:])
    return smooth


class Mean:
    """Mean of whitened spectra on an axis that all share, and how far each place of it stands out.

    From the power [bins] of each record, the bin of each of the `places` (Hz or orders, evenly spaced) in it, the
    places about each that its floor is taken from, and the state of each record's bearing. `z` [places] are normal
    deviates where there is nothing but noise, NaN beyond what most of the records reach. `common` [places] is z above
    the higher of both sides of a line, which a sharp mode does not exceed, and the least z when the records of any one
    state are left out, so that lines of impacts, which only one state has, do not count.
    """

    def __init__(
        self,
        powers: Iterable[Single],
        places: Array,
        indices: Sequence[NDArray[np.int64]],
        about: int,
        kinds: Sequence[str],
    ) -> None:
        self.places, self.step = places, float(places[1] - places[0]) if places.size > 1 else 1.0
        names = sorted(set(kinds))
        totals, counts = np.zeros((2, len(names), places.size))
        for power, index, kind in zip(powers, indices, kinds, strict=True):
            inside = (index >= 2) & (index < power.size - 2)
            totals[names.index(kind), inside] += power[index[inside]]
            counts[names.index(kind)] += inside
        total, count = totals.sum(axis=0), counts.sum(axis=0)
        self.z = np.full(places.size, np.nan)
        self.common = self.z
        known = count > 0.6 * len(kinds)
        if known.sum() <= about:
            return
        floor = np.maximum(local_floor(total[known] / count[known], about), 1e-9)

        def deviates(total: Array, count: Array) -> Array:
            return (np.cbrt(total / np.maximum(count, 1) / floor) - 1) * np.sqrt(count) / SPREAD

        z = deviates(total[known], count[known])
        # Non-stationary noise scatters more.
        spread = max(1.4826 * float(medians(np.abs(z))), 1.0)
        self.z[known] = z / spread
        floor = np.maximum(floor, _beside_each(total[known] / count[known], _NEAR * max(about // _ABOUT, 1)))
        left = [deviates(t, c) for t, c in zip((total - totals)[:, known], (count - counts)[:, known], strict=True)]
        common = np.min([*(left if len(names) > 1 else []), deviates(total[known], count[known])], axis=0)
        self.common = np.full(places.size, np.nan)
        self.common[known] = common / spread

    @classmethod
    def in_hz(cls, records: Sequence[Whitened], envelope: bool = False) -> Mean:
        """Mean on a frequency axis, Hz."""
        powers, resolutions, tops = _spectra(records, envelope)
        # As fine as the longest record: a coarser one is read more than once, but no line falls between two places.
        step = min(resolutions)
        places = np.arange(2.0, max(tops) / step) * step
        indices = [np.rint(places / df).astype(int) for df in resolutions]
        return cls(powers, places, indices, int(_ABOUT * max(resolutions) / step) | 1, [r.kind for r in records])

    @classmethod
    def in_orders(cls, records: Sequence[Whitened], envelope: bool = False) -> Mean:
        """Mean on an axis of shaft orders."""
        powers, resolutions, _ = _spectra(records, envelope)
        units = [r.shaft_hz / df for r, df in zip(records, resolutions, strict=True)]
        step = min(_STEP, 1 / max(units))
        places = np.arange(0.3, 45.0 if envelope else _TOP_ORDER, step)
        indices = [np.rint(places * unit).astype(int) for unit in units]
        return cls(powers, places, indices, int(_ABOUT / min(units) / step) | 1, [r.kind for r in records])

    def at(self, places: Array) -> Array:
        """z at the nearest places of the axis; NaN off it."""
        index = np.rint((places - self.places[0]) / self.step).astype(int) if self.places.size else np.zeros(0, int)
        inside = (index >= 0) & (index < self.places.size)
        return np.where(inside, self.z[np.clip(index, 0, self.places.size - 1)], np.nan)


def _beside_each(mean: Array, offsets: NDArray[np.int64]) -> Array:
    """[places] Level just below each place or just above it, whichever is higher."""
    reach = int(offsets.max())
    padded = np.pad(mean, reach, mode="edge")
    sides = [
        medians(np.stack([padded[reach + sign * k : reach + sign * k + mean.size] for k in offsets], axis=-1))
        for sign in (-1, 1)
    ]
    return np.maximum(*sides)


def _spectra(records: Sequence[Whitened], envelope: bool) -> tuple[Iterable[Single], list[float], list[float]]:
    """Of each record its spectrum, or that of its envelope, Hz per bin, and where it ends, Hz."""
    if envelope:
        steps = [r.envelope_df_hz for r in records]
        return [r.envelope for r in records], steps, [r.envelope.size * r.envelope_df_hz for r in records]
    return (r.power() for r in records), [r.df_hz for r in records], [r.logs.size * r.df_hz for r in records]


def combined_z(z: Array) -> Any:
    """Combined z (Stouffer) of lines [..., lines], unknown ones left out; each counts as at most `MOST_Z`."""
    known = np.isfinite(z)
    total = np.where(known, np.clip(z, -MOST_Z, MOST_Z), 0.0).sum(axis=-1)
    return np.where(known.any(axis=-1), total / np.sqrt(np.maximum(known.sum(axis=-1), 1)), np.nan)


def max_z(z: Array) -> float:
    """The highest z; NaN where none is known."""
    known = z[np.isfinite(z)]
    return float(known.max()) if known.size else math.nan
