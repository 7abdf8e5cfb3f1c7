"""A ball defect that strikes one race harder than the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import measurements
from twingap.effects._fault_effect import FaultEffect
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.base import parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.registry import register


@register
@dataclass(frozen=True)
class BallContact(FaultEffect):
    """Every second impact of a ball defect is weaker: a ball meets the outer and the inner race in turn.

    With depth 1 there is one impact a spin, at BSF instead of 2 BSF; between, the envelope has lines at odd multiples
    of BSF. Other faults are left unchanged. Simulators without a list of impacts cannot have it.
    """

    references: ClassVar[tuple[str, ...]] = (RANDALL_ANTONI,)
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("impact_scatter", "cage_modulation", "load_zone")
    deciding_measurement: ClassVar[str] = measurements.LOAD
    trained: ClassVar[bool] = False

    depth: float = parameter(
        0.5, unit="", plausible=(0.05, 1.0), allowed=(0, 1), strength=True,
        doc="part by which every second impact is weaker",
    )  # fmt: skip

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        if draft.condition.fault == "ball":
            weaker = impacts.passes % 2 == 1
            impacts.amplitudes = np.where(weaker, (1 - self.depth) * impacts.amplitudes, impacts.amplitudes)

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation != "impacts":
            return "the simulator has no list of impacts"
        return super().cannot_act_on(draft)
