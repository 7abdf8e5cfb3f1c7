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
from twingap.records import Record
from twingap.signal.record_transforms import tone_power

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
"""Bins within which a harmonic of the shaft is beside a line. A larger value leaves out more records."""
_CLEAR: Final = 30.0
"""Power of a line's highest bin over the median beside it from which it is clear. A larger value misses weak lines."""
_FEWEST: Final = 3
"""Smallest number of records that show a common line."""
_IN_MOST: Final = 0.75
"""Part of the records in which it is clear. A smaller value allows lines of some records."""
_ALIKE: Final = 0.1
"""Largest median deviation of its amplitudes, relative. A larger value allows lines that change between records."""


def add_harmonics(draft: Draft, turns: Array, base_hz: float, levels: Reals, phases_turns: Reals) -> None:
    """Add cosines at multiples 1, 2, ... of `turns`, of `levels` healthy RMS, below half the sampling rate."""
    count = min(levels.size, math.ceil(draft.condition.fs_hz / 2 / base_hz) - 1)
    amplitudes = draft.reference_rms * levels * np.exp(2j * np.pi * phases_turns)
    draft.x += harmonics(turns, amplitudes[: max(count, 0)].tolist())


def common_levels(records: Iterable[Record], frequencies_hz: Array) -> Array:
    """[frequencies] Amplitudes of lines at fixed frequencies that records have in common, in their unit; 0 without one.

    Records in which a harmonic of the shaft lies beside a line are left out for that line.
    """
    levels: list[list[float]] = [[] for _ in frequencies_hz]
    clear = np.zeros(frequencies_hz.size)
    for record in records:
        c = record.condition
        bin_hz, shaft_hz = c.fs_hz / c.n_samples, c.speed_rpm / 60
        power = tone_power(np.asarray(record.samples, float))
        for number, frequency_hz in enumerate(frequencies_hz):
            place, turns = round(float(frequency_hz) / bin_hz), float(frequency_hz) / shaft_hz
            inside = _FAR < place < power.size - _FAR - 1
            if not inside or abs(turns - round(turns)) * shaft_hz < _BESIDE * bin_hz:
                continue
            near = power[place - _LOBE : place + _LOBE + 1]
            beside = power[place - _FAR : place - _LOBE], power[place + _LOBE + 1 : place + _FAR + 1]
            floor = float(np.median(np.concatenate(beside)))
            clear[number] += near.max() > _CLEAR * floor
            # The main lobe of a Hann window holds 1.5 times the power of its middle bin.
            squared = 2 * (float(near.sum()) - near.size * floor / math.log(2)) / 1.5
            levels[number].append(math.sqrt(max(squared, 0.0)))
    out = np.zeros(frequencies_hz.size)
    for number, own in enumerate(levels):
        if len(own) >= _FEWEST and clear[number] >= _IN_MOST * len(own):
            level = float(np.median(own))
            out[number] = level if np.median(np.abs(np.array(own) - level)) < _ALIKE * level else 0.0
    return out


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
