"""Tones at multiples of shaft speed, from unbalance and misalignment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import TONES
from twingap.effects._references import ISO_13373, RANDALL_BOOK
from twingap.effects._tones import UnevenHarmonics, add_harmonics, speed_dependence, uneven_factors
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import tone_level
from twingap.effects.machine import Machine
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class ShaftHarmonics(Effect):
    """Tones at 1, 2 and 3 times shaft speed (unbalance, misalignment): they survive synchronous averaging.

    Phases are random from record to record, since records start at no particular shaft angle.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (ISO_13373, RANDALL_BOOK)
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = ("looseness", "gear_mesh", "mains_interference")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = TONES

    level_1x: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 5.0), log=True, doc="amplitude at shaft speed (unbalance)"
    )
    level_2x: float = parameter(
        0.3, unit="healthy rms", plausible=(0.01, 5.0), log=True, doc="amplitude at twice shaft speed (misalignment)"
    )
    level_3x: float = parameter(
        0.15, unit="healthy rms", plausible=(0.005, 5.0), log=True, doc="amplitude at three times shaft speed"
    )

    @property
    def levels(self) -> Array:
        """[3] Amplitude of each, healthy rms."""
        return np.array([self.level_1x, self.level_2x, self.level_3x])

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        add_harmonics(draft, draft.turns, draft.shaft_hz, self.levels, rng.random(3))

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        strongest = tone_level(rng, machine, 1.5)
        levels = strongest * 10 ** (-rng.uniform(0, 12, 3) / 20)
        levels[rng.integers(3)] = strongest
        return {f"level_{k}x": float(level) for k, level in enumerate(levels, start=1)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        factors = tuple(uneven_factors(rng).tolist())
        return SpeedDependentHarmonics(**self.parameter_values(), factors=factors, **speed_dependence(machine, rng))


@dataclass(frozen=True)
class SpeedDependentHarmonics(UnevenHarmonics, ShaftHarmonics):
    """Forces of unbalance and misalignment, which grow with speed."""
