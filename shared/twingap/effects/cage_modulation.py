"""Impacts modulated once per turn of the cage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._fault_effect import FaultEffect
from twingap.effects._features import STRENGTH
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.angle import cosine
from twingap.effects.base import Effect, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class CageModulation(FaultEffect):
    """All impacts swell and fade once per cage turn, whatever the fault (rollers of unequal size, a worn pocket)."""

    references: ClassVar[tuple[str, ...]] = (RANDALL_ANTONI,)
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("load_zone", "impact_scatter")
    deciding_measurement: ClassVar[str] = measurements.LOAD
    features: ClassVar[tuple[str, ...]] = STRENGTH
    draw_weight: ClassVar[float] = 1.4

    depth: float = parameter(
        0.3, unit="", plausible=(0.05, 1.0), allowed=(0, 1), strength=True,
        doc="half the swing of the strength over its mean",
    )  # fmt: skip

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        impacts.amplitudes = impacts.amplitudes * self._weight(draft, impacts.turns, rng)

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.modulate(self._weight(draft, draft.turns, rng))

    def _weight(self, draft: Draft, turns: Array, rng: np.random.Generator) -> Array:
        rate = draft.bearing.ftf * draft.cage_speed_ratio
        return 1 + self.depth * cosine(rate * turns + rng.random())

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        return {"depth": log_uniform(rng, 0.09, 1.0)} if faults(machine) else None

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return OneLargeRoller(**self.parameter_values(), sharp=math.exp(rng.uniform(math.log(0.5), math.log(8))))


@dataclass(frozen=True)
class OneLargeRoller(CageModulation):
    """One roller larger than the rest: impacts swell in a short part of the cage's turn.

    Parameters
    ----------
    sharp : float
        Concentration of the swelling (von Mises).
    """

    sharp: float = 1.0

    def _weight(self, draft: Draft, turns: Array, rng: np.random.Generator) -> Array:
        rate = draft.bearing.ftf * draft.cage_speed_ratio
        bump, low = np.exp(self.sharp * (cosine(rate * turns + rng.random()) - 1)), math.exp(-2 * self.sharp)
        return np.asarray(1 + self.depth * (2 * (bump - low) / (1 - low) - 1))
