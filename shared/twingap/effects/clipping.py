"""Saturation of the converter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import measurements
from twingap.effects._references import IEEE_1057
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import faults
from twingap.effects.machine import Machine
from twingap.effects.registry import register


@register
@dataclass(frozen=True)
class Clipping(Effect):
    """Saturation: samples beyond the rails lie on them, and make atoms there in the amplitude distribution."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = (IEEE_1057,)
    group: ClassVar[str] = "acquisition"
    look_alikes: ClassVar[tuple[str, ...]] = ("impact_scatter", "quantisation")
    deciding_measurement: ClassVar[str] = measurements.CHAIN
    features: ClassVar[tuple[str, ...]] = (
        "converter.*", "background.quantile_*", "background.crest_log", "background.kurtosis_log",
    )  # fmt: skip

    rail: float = parameter(
        4.0, unit="healthy rms", plausible=(1.5, 15.0), allowed=(1e-9, 1e9), log=True, strength=False,
        doc="largest magnitude recorded",
    )  # fmt: skip

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        rail = self.rail * draft.reference_rms
        draft.x = np.clip(draft.x, -rail, rail)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        # Where the strongest records reach is known only roughly here; a rail that no sample reaches is no effect.
        reach = 3.2 if not faults(machine) else max(machine.parameters.impact_amplitude.values()) + 2.5
        return {"rail": max(reach * rng.uniform(0.25, 0.9), 1.6)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return UnevenClipping(**self.parameter_values(), lower=rng.uniform(0.6, 1.5))


@dataclass(frozen=True)
class UnevenClipping(Clipping):
    """Rails that do not lie alike about zero.

    Parameters
    ----------
    lower : float
        Lower rail over the upper.
    """

    lower: float = 1.0

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        rail = self.rail * draft.reference_rms
        draft.x = np.clip(draft.x, -self.lower * rail, rail)
