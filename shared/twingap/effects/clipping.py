"""Saturation of the converter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._references import IEEE_1057
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import faults
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register
from twingap.records import Record
from twingap.signal.rails import best_rail, extremes

Array = NDArray[np.float64]

_CERTAIN: Final = 4.0
_BEYOND_DOUBT: Final = 6.0
"""Evidence (`signal.rails`) from which records have a rail, and from which that alone is a gap. Smaller values find
rails that are reached more seldom, and more by chance."""
_OF_TWIN: Final = 2.0
"""Evidence from which the twin may have a rail itself. A larger value adds a rail to twins that have one."""
_SAME_RAIL: Final = 0.01
"""Largest relative difference of the rails of records and sides. A larger value takes two rails for one."""


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

    @classmethod
    def certain(cls, seen: Observations) -> bool:
        """Where records reach one level again and again and never exceed it, and the twin's do not."""
        return _is_rail(seen, _CERTAIN)

    @classmethod
    def shows_gap(cls, seen: Observations) -> bool:
        return _is_rail(seen, _BEYOND_DOUBT)

    @classmethod
    def read_off(cls, records: Iterable[Record], simulated: Iterable[Record]) -> Mapping[str, float]:
        """The rail, where records that reach it agree on it and it is the same on both sides."""
        found = [extremes(np.asarray(record.samples, float)) for record in records]
        sides = [*zip(*found, strict=True), *((extreme,) for both in found for extreme in both)]  # of all, of each
        rails = [abs(rail.level) for rail in map(best_rail, sides) if rail.evidence >= _CERTAIN]
        if not rails or max(rails) - min(rails) > _SAME_RAIL * max(rails):
            return {}
        return {"rail": float(np.mean(rails))}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return UnevenClipping(**self.parameter_values(), lower=rng.uniform(0.6, 1.5))


def _is_rail(seen: Observations, least: float) -> bool:
    evidence, over_twin = (seen.features.get(f"pooled|rail{of}", 0.0) for of in ("", ".diff"))
    return evidence >= least and evidence - over_twin < _OF_TWIN


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
