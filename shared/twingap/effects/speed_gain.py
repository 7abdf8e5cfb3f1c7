"""Excitation that depends on speed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from twingap.effects import measurements
from twingap.effects._features import LEVEL
from twingap.effects._references import PAPER1
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register

_APART: Final = math.log(1.12)
"""Smallest log ratio of speeds of one fault for which a gain is drawn. A larger value draws fewer."""
_FELT: Final = 0.2
"""Smallest `on_noise` at which healthy records count as showing the gain. A larger value draws fewer."""
_SHOWN: Final = 0.15
"""Slope of log amplitudes times the spread of log speeds that just shows: three times the error of measured levels."""


@register
@dataclass(frozen=True)
class SpeedGain(Effect):
    """All excitation is stronger or weaker with speed, S = (speed / reference)^exponent, at the record's mean speed.

    Eq. 10 of paper 1 with c constant is exponent 1. White noise of the measuring chain and disturbances do not change.
    The noise of a healthy bearing may depend on speed less than impacts do (`on_noise`).
    """

    stage: ClassVar[Stage] = Stage.EXCITATION
    references: ClassVar[tuple[str, ...]] = (f"{PAPER1}, eqs. 1 and 10",)
    group: ClassVar[str] = "operation"
    look_alikes: ClassVar[tuple[str, ...]] = ("damage_growth", "sensor_rolloff")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = LEVEL
    trends: ClassVar[tuple[str, ...]] = ("on_speed",)
    draw_weight: ClassVar[float] = 2.0

    exponent: float = parameter(
        1.0, unit="", plausible=(-1.0, 3.0), allowed=(-10, 10), strength=True,
        doc="power of the speed; 0 is no influence",
    )  # fmt: skip
    on_noise: float = parameter(
        1.0, unit="", plausible=(0.0, 1.0), allowed=(0, 1), doc="structure noise follows by this part of the exponent"
    )
    reference_speed_rpm: float = parameter(
        1800.0, unit="rpm", plausible=(100.0, 10000.0), allowed=(1e-3, 1e7), log=True, fitted=False,
        relative_to="speed", doc="speed at which the gain is 1",
    )  # fmt: skip

    def gain(self, speed_rpm: float) -> float:
        """S at this speed."""
        return float((speed_rpm / self.reference_speed_rpm) ** self.exponent)

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        gain = self.gain(draft.condition.speed_rpm)
        on_noise = gain**self.on_noise
        if draft.impacts is not None:
            draft.impacts.amplitudes = draft.impacts.amplitudes * gain
        draft.amplify_force(on_noise)
        if draft.excitation != "impacts":
            draft.modulate(gain if draft.faulty else on_noise)
        if draft.background is not None:
            draft.background = draft.background * on_noise

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        # Where impacts depend on speed, the noise of the structure may as much, less or not at all.
        on_noise = float(rng.choice([0.0, rng.random(), 1.0], p=[0.4, 0.3, 0.3]))
        # A level of each fault is free, so only one fault at several speeds shows a gain; noise does where it follows.
        courses = [
            np.log([c.speed_rpm for c in machine.conditions if c.fault == kind])
            for kind in (*sorted(faults(machine)), *(["healthy"] if on_noise > _FELT else []))
        ]
        courses = [x for x in courses if x.size and np.ptp(x) > _APART]
        if not courses:
            return None
        sign = 1 if rng.random() < 0.6 else -1  # higher speed is mostly stronger, but may move away from a resonance
        speeds = [c.speed_rpm for c in machine.conditions]
        reference = 1800.0 if rng.random() < 0.3 else float(np.median(speeds))
        least = float(np.clip(_SHOWN / math.sqrt(sum(float(((x - x.mean()) ** 2).sum()) for x in courses)), 0.15, 0.8))
        return {
            "exponent": sign * log_uniform(rng, least, 4.5), "reference_speed_rpm": reference, "on_noise": on_noise,
        }  # fmt: skip

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return BentSpeedGain(**self.parameter_values(), bend=self.exponent * rng.normal(0, 0.5))

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        for trend in ("trend|speed_impacts", "trend|speed_partial", "trend|speed_harmonics"):
            exponent = seen.features[trend]
            if math.isfinite(exponent):
                for part in (0.0, 1.0):
                    yield self.moved(exponent=exponent, on_noise=part, reference_speed_rpm=seen.speed_rpm)


@dataclass(frozen=True)
class BentSpeedGain(SpeedGain):
    """A gain that no power of the speed describes: it bends.

    Parameters
    ----------
    bend : float
        Of the logarithm of the gain over the squared logarithm of the speed.
    """

    bend: float = 0.0

    def gain(self, speed_rpm: float) -> float:
        """S at this speed."""
        log = math.log(speed_rpm / self.reference_speed_rpm)
        return math.exp(self.exponent * log + self.bend * min(log * log, 1.0))
