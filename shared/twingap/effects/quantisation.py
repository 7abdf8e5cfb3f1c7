"""A coarse converter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import measurements
from twingap.effects._references import IEEE_1057
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register


@register
@dataclass(frozen=True)
class Quantisation(Effect):
    """A coarse converter: all samples are integer multiples of one step."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = (IEEE_1057, "Widrow & Kollar 2008, Quantization noise")
    group: ClassVar[str] = "acquisition"
    look_alikes: ClassVar[tuple[str, ...]] = ("clipping", "dropout")
    deciding_measurement: ClassVar[str] = measurements.CHAIN
    features: ClassVar[tuple[str, ...]] = ("converter.*", "background.white_level", "background.quantile_50")

    step: float = parameter(
        0.25, unit="healthy rms", plausible=(0.01, 2.0), allowed=(1e-9, 1e9), log=True, doc="step of the converter"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        step = self.step * draft.reference_rms
        draft.x = np.rint(draft.x / step) * step

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {"step": log_uniform(rng, 0.05, 2.0)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return MidRiseQuantisation(**self.parameter_values())


@dataclass(frozen=True)
class MidRiseQuantisation(Quantisation):
    """A converter without a zero of its own: samples lie halfway between multiples of its step."""

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        step = self.step * draft.reference_rms
        draft.x = (np.floor(draft.x / step) + 0.5) * step
