"""Variation of the shaft's speed within a record."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import TIMING
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class SpeedFluctuation(Effect):
    """The shaft's speed varies within a record; its mean over the record stays `speed_rpm`.

    The relative speed is a smooth random process: twelve cosines of random frequency below `bandwidth_hz` and random
    phase. All that follows the angle smears in the spectrum, more at higher orders, and stands sharp again after order
    tracking. Acts on impacts and rollers through the angle; a finished waveform is resampled over the angle, by which
    its resonances move a little too (by the speed's own per cent). `level` is the process's: about its own mean a short
    record varies less, since its slow waves do not turn in it (0.7 of `level` in half a second at 2 Hz).
    """

    stage: ClassVar[Stage] = Stage.SHAFT
    references: ClassVar[tuple[str, ...]] = (RANDALL_ANTONI,)
    group: ClassVar[str] = "kinematics"
    look_alikes: ClassVar[tuple[str, ...]] = ("slip_jitter", "mean_slip")
    deciding_measurement: ClassVar[str] = measurements.TACHO
    features: ClassVar[tuple[str, ...]] = TIMING
    draw_weight: ClassVar[float] = 1.6

    level: float = parameter(
        0.01, unit="", plausible=(0.001, 0.05), allowed=(0, 0.3), log=True, strength=True,
        doc="rms of the relative speed variation",
    )  # fmt: skip
    bandwidth_hz: float = parameter(
        2.0, unit="Hz", plausible=(0.5, 10.0), allowed=(0.01, 1000.0), log=True, doc="fastest variation of the speed"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        n, wander = draft.t.size, self._wander(rng)
        if n < 2:
            return
        # Sixteen knots per fastest cycle are as good as every sample, and far fewer.
        span = draft.t[-1] - draft.t[0]
        knots = np.linspace(0.0, span, min(n, 2 + math.ceil(16 * self.bandwidth_hz * span)))
        # Three sigma bound the speed away from standstill at the largest level allowed.
        relative = np.interp(draft.t, knots, 1 + self.level * np.clip(wander(knots), -3, 3))
        travelled = np.concatenate(([0.0], np.cumsum(0.5 * (relative[1:] + relative[:-1]))))
        draft.turns = draft.turns[0] + travelled * ((draft.turns[-1] - draft.turns[0]) / travelled[-1])

    def _wander(self, rng: np.random.Generator) -> Callable[[Array], Array]:
        """How far the speed departs from its mean over time, s; of variance 1."""
        count = 12
        frequencies = self.bandwidth_hz * rng.uniform(0.05, 1.0, count)
        phases = 2 * np.pi * rng.random(count)

        def over(t: Array) -> Array:
            waves = np.cos(2 * np.pi * frequencies[:, None] * t + phases[:, None])
            return np.asarray(np.sqrt(2 / count) * waves.sum(axis=0))

        return over

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        if not faults(machine):
            return None
        return {"level": log_uniform(rng, 0.0015, 0.05), "bandwidth_hz": log_uniform(rng, 0.5, 10.0)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        ramp = rng.uniform(0, 1) if rng.random() < 0.6 else 0.0
        return GovernorHunting(**self.parameter_values(), ramp=ramp)


@dataclass(frozen=True)
class GovernorHunting(SpeedFluctuation):
    """A governor that hunts while the shaft runs up or down: one wave and a ramp.

    Parameters
    ----------
    ramp : float
        Part of the variance that the ramp has.
    """

    ramp: float = 0.0

    def _wander(self, rng: np.random.Generator) -> Callable[[Array], Array]:
        hz, phase, sign = self.bandwidth_hz * rng.uniform(0.2, 1.0), 2 * np.pi * rng.random(), rng.choice((-1.0, 1.0))

        def over(t: Array) -> Array:
            wave = math.sqrt(2 * (1 - self.ramp)) * np.cos(2 * np.pi * hz * t + phase)
            return np.asarray(wave + sign * math.sqrt(3 * self.ramp) * np.linspace(-1, 1, t.size))

        return over
