"""Tones of effects: harmonics added to a draft, and harmonics whose amplitudes do not decay geometrically."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects.angle import harmonics
from twingap.effects.base import Effect
from twingap.effects.draft import Draft
from twingap.effects.machine import Machine

Array = NDArray[np.float64]
Reals = NDArray[np.floating[Any]]

_UNEVENNESS: Final = 0.7
"""Standard deviation of the logarithm of the factors on uneven harmonics. A larger value makes them less regular."""
_FACTORS: Final = 64


def add_harmonics(draft: Draft, turns: Array, base_hz: float, levels: Reals, phases_turns: Reals) -> None:
    """Add cosines at multiples 1, 2, ... of `turns`, of `levels` healthy RMS, below half the sampling rate."""
    count = min(levels.size, math.ceil(draft.condition.fs_hz / 2 / base_hz) - 1)
    amplitudes = draft.reference_rms * levels * np.exp(2j * np.pi * phases_turns)
    draft.x += harmonics(turns, amplitudes[: max(count, 0)].tolist())


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
