"""A part of the excitation that is noise with the rhythm of the impacts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from twingap.effects import measurements
from twingap.effects._fault_effect import FaultEffect
from twingap.effects.base import parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.registry import register

_BURST: Final = 8
"""Random impulses of one burst. More make smoother noise and take longer."""


@register
@dataclass(frozen=True)
class ImpulsiveShare(FaultEffect):
    """A part of each impact's energy is a burst of noise: many small contacts of rough surfaces after the impact.

    The burst passes the same path as the impact. Its impulses have random amplitudes and delays that are
    exponentially distributed; the energy of impact and burst together stays. Simulators without a list of impacts
    cannot have it.
    """

    references: ClassVar[tuple[str, ...]] = (
        "Antoni & Randall 2003, A stochastic model for simulation and diagnostics of rolling element bearings with "
        "localized faults, doi:10.1115/1.1569940",
    )
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("impact_scatter", "slip_jitter", "distributed_roughness")
    deciding_measurement: ClassVar[str] = measurements.LONGER
    trained: ClassVar[bool] = False
    irregular_impacts: ClassVar[tuple[Mapping[str, Mapping[str, float]], ...]] = ({"impulsive_share": {"share": 0.15}},)

    share: float = parameter(
        0.5, unit="", plausible=(0.05, 0.95), allowed=(0, 1), strength=True, doc="part of the energy in the burst"
    )
    duration: float = parameter(
        0.1, unit="impact spacings", plausible=(0.01, 0.4), allowed=(0, 5.0), log=True, doc="mean delay of the impulses"
    )

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        n = impacts.turns.size
        late = self.duration / draft.fault_order * rng.exponential(size=(_BURST, n))
        size = math.sqrt(self.share / _BURST) * rng.standard_normal((_BURST, n)) * impacts.amplitudes
        impacts.turns = np.concatenate((impacts.turns, (impacts.turns + late).ravel()))
        impacts.amplitudes = np.concatenate((math.sqrt(1 - self.share) * impacts.amplitudes, size.ravel()))
        impacts.passes = np.tile(impacts.passes, 1 + _BURST)
        if impacts.delays is not None:
            impacts.delays = np.tile(impacts.delays, 1 + _BURST)

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation != "impacts":
            return "the simulator has no list of impacts"
        return super().cannot_act_on(draft)
