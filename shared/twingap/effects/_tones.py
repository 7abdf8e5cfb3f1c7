"""Tones of effects: harmonics added to a draft, and harmonics whose amplitudes do not decay geometrically."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects.angle import harmonics
from twingap.effects.base import Effect
from twingap.effects.draft import Draft
from twingap.effects.machine import Machine
from twingap.records import Condition, Record
from twingap.signal.record_transforms import tone_spectrum

Array = NDArray[np.float64]
Reals = NDArray[np.floating[Any]]

_UNEVENNESS: Final = 0.7
"""Standard deviation of the logarithm of the factors on uneven harmonics. A larger value makes them less regular."""
_FACTORS: Final = 64
_LOBE: Final = 2
"""Bins on either side of a line that belong to it."""
_FAR: Final = 20
"""Bins on either side of a line from which the noise beside it is estimated."""
_BESIDE: Final = 4.0
"""Bins within which a harmonic of the shaft is beside a line. A larger value fits it where it is no matter."""
RESOLVED: Final = 1.5
"""Bins from which the two are resolved. A smaller value takes a strong harmonic for a weak line."""
_SPEED_BINS: Final = np.linspace(-0.4, 0.4, 9)
"""Bins by which the harmonic may lie beside its place, as speeds have errors. Larger ones fit other lines."""
_CLEAR_OF_SHAFT: Final = 6.0
"""Largest mean power, over the median beside, that the fit of both may leave. A larger value fits lines that move."""
_CLEAR: Final = 10.0
"""Power of a line's highest bin over the median beside it from which it is clear: noise reaches it in one of 200
records, and in most of them never. A larger value misses weak lines."""
FEWEST: Final = 2
"""Smallest number of records that show a common line. A larger number leaves hums unread where few speeds keep clear of
the mains."""
_IN_MOST: Final = 0.75
"""Part of the records in which it is clear. A smaller value allows lines of some records."""
_ALIKE: Final = 0.1
"""Largest median deviation of its amplitudes, relative, beside that of noise. A larger value allows lines that change
between records."""


def add_harmonics(draft: Draft, turns: Array, base_hz: float, levels: Reals, phases_turns: Reals) -> None:
    """Add cosines at multiples 1, 2, ... of `turns`, of `levels` healthy RMS, below half the sampling rate."""
    count = min(levels.size, math.ceil(draft.condition.fs_hz / 2 / base_hz) - 1)
    amplitudes = draft.reference_rms * levels * np.exp(2j * np.pi * phases_turns)
    draft.x += harmonics(turns, amplitudes[: max(count, 0)].tolist())


def common_levels(records: Iterable[Record], frequencies_hz: Array) -> Array:
    """[frequencies] Amplitudes of lines at fixed frequencies that records have in common, in their unit; 0 without one.

    A harmonic of the shaft near a line is fitted together with it; records that do not resolve the two are left out for
    that line.
    """
    levels: list[list[float]] = [[] for _ in frequencies_hz]
    noises: list[list[float]] = [[] for _ in frequencies_hz]
    clear = np.zeros(frequencies_hz.size)
    for record in records:
        c = record.condition
        bin_hz = c.fs_hz / c.n_samples
        spectrum = tone_spectrum(np.asarray(record.samples, float))
        power = np.square(np.abs(spectrum))
        for number, frequency_hz in enumerate(frequencies_hz):
            place = round(float(frequency_hz) / bin_hz)
            apart = _bins_to_shaft(float(frequency_hz), c)
            if not _FAR < place < power.size - _FAR - 1 or abs(apart) < RESOLVED:
                continue
            near = power[place - _LOBE : place + _LOBE + 1]
            beside = power[place - _FAR : place - _LOBE], power[place + _LOBE + 1 : place + _FAR + 1]
            floor = float(np.median(np.concatenate(beside)))
            if abs(apart) < _BESIDE:
                highest, rest = _beside_shaft(spectrum, float(frequency_hz) / bin_hz, apart)
                if rest > _CLEAR_OF_SHAFT * floor:  # another line, or one that moves
                    continue
                squared = 2 * highest
            else:
                highest = float(near.max())
                # The main lobe of a Hann window holds 1.5 times the power of its middle bin.
                squared = 2 * (float(near.sum()) - near.size * floor / math.log(2)) / 1.5
            clear[number] += highest > _CLEAR * floor
            levels[number].append(math.sqrt(max(squared, 0.0)))
            # Noise of a bin's power has the mean floor / log 2; half of it is in phase with the line.
            noises[number].append(math.sqrt(floor / math.log(2)))
    out = np.zeros(frequencies_hz.size)
    for number, own in enumerate(levels):
        if len(own) >= FEWEST and clear[number] >= _IN_MOST * len(own):
            level = float(np.median(own))
            alike = math.hypot(_ALIKE * level, float(np.median(noises[number])))
            out[number] = level if np.median(np.abs(np.array(own) - level)) < alike else 0.0
    return out


def resolved_from_shaft(frequency_hz: float, condition: Condition) -> bool:
    """Whether records of a condition resolve a line from the multiples of shaft speed."""
    return abs(_bins_to_shaft(frequency_hz, condition)) >= RESOLVED


def _bins_to_shaft(frequency_hz: float, condition: Condition) -> float:
    """Bins from a frequency to the nearest multiple of shaft speed, negative below it."""
    shaft_hz, bin_hz = condition.speed_rpm / 60, condition.fs_hz / condition.n_samples
    return (max(round(frequency_hz / shaft_hz), 1) * shaft_hz - frequency_hz) / bin_hz


def _beside_shaft(spectrum: NDArray[np.complex128], place: float, apart: float) -> tuple[float, float]:
    """Power of a line, and mean power that is left, where a harmonic of the shaft is fitted with it.

    The line lies at `place` bins, the harmonic `apart` bins from it, or a little beside, as speeds are known.
    """
    first = round(place + min(apart, 0.0)) - _LOBE
    bins = np.arange(first, round(place + max(apart, 0.0)) + _LOBE + 1)
    wanted = spectrum[bins]
    best = (math.inf, 0.0)
    for shift in _SPEED_BINS:
        basis = hann_lobe(bins[:, None] - place - np.array([0.0, apart + shift]))
        found = np.linalg.lstsq(basis, wanted, rcond=None)[0]
        rest = float(np.mean(np.square(np.abs(wanted - basis @ found))))
        best = min(best, (rest, float(np.abs(found[0]) ** 2)))
    return best[1], best[0]


def hann_lobe(bins: Array) -> NDArray[np.complex128]:
    """Hann spectrum, 1 at the middle, of a line this many bins below (not more than a few), for a long record."""
    turns = np.exp(1j * np.pi * -bins)
    near = [np.sinc(bins + shift) * (1.0 if shift == 0 else 0.5) for shift in (-1, 0, 1)]
    return np.asarray(turns * sum(near))


def uneven_factors(rng: np.random.Generator) -> Array:
    """Random factors on harmonics, lognormal."""
    return np.asarray(np.exp(_UNEVENNESS * rng.standard_normal(_FACTORS)))


def speed_dependence(machine: Machine, rng: np.random.Generator) -> dict[str, Any]:
    """Random `rise` and `reference_rpm` of `UnevenHarmonics`; half of the machines have none."""
    if rng.random() >= 0.5:
        return {}
    middle = float(np.median([c.speed_rpm for c in machine.conditions]))
    return {"rise": rng.uniform(0.5, 2.0), "reference_rpm": middle}


@dataclass(frozen=True)
class UnevenHarmonics(Effect):
    """Mixin: harmonics with a factor each instead of a geometric decay. Forces of rotating parts may grow with speed.

    Parameters
    ----------
    factors : tuple of float
    rise : float
        Power of the speed that all follow: 2 for an unbalance.
    reference_rpm : float
        Speed at which the amplitudes have their stated values.
    """

    factors: tuple[float, ...] = (1.0,)
    rise: float = 0.0
    reference_rpm: float = 1800.0

    @property
    def levels(self) -> Array:
        """[harmonics] Amplitude of each, healthy rms."""
        own: Array = super().levels  # type: ignore[misc]  # of the next class in the method resolution order
        return np.asarray(own * np.resize(np.array(self.factors), own.size))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        """Apply the next class in the method resolution order, times the gain of this speed."""
        before, draft.x = draft.x, np.zeros_like(draft.x)
        super().apply(draft, rng)  # type: ignore[safe-super]
        draft.x = before + (draft.condition.speed_rpm / self.reference_rpm) ** self.rise * draft.x
