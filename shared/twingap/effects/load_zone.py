"""Weights of impacts by the local load."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._fault_effect import AROUND, FaultEffect, point_contact_load
from twingap.effects._features import STRENGTH
from twingap.effects._references import MCFADDEN, PAPER1
from twingap.effects.angle import cosine
from twingap.effects.base import Effect, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register

Array = NDArray[np.float64]

_EXTENTS: Final = (1.0, 0.5, 0.3)
"""Extents that are tried for each unit. More fit closer and take longer."""


@register
@dataclass(frozen=True)
class LoadZone(FaultEffect):
    """Impacts are weighted by the load at their angle, q = 1 + depth cos(angle); in a zone, by Stribeck's law.

    `extent` is the loaded part of the diameter. With 1, the load is a cosine of the angle. With clearance it is below
    one half, and the varying part of the load is 1 - (1 - cos(angle)) / (2 extent) within the zone and 0 beyond it
    (without the exponent of the contact, 3/2 for balls, because impacts need not be proportional to the load).

    A defect of the inner race turns through the load zone at shaft rate, one of a rolling element at cage rate. The
    outer race does not turn, and a cage carries no load. With `rotating`, the load turns with the shaft, as that of an
    unbalance: it passes a defect of the outer race once a turn, one of a rolling element once per turn of the shaft
    against the cage, and stays where it is on the inner race. The initial angle of the defect is random. On rollers the
    weight is additional to the load of the contact model.
    """

    references: ClassVar[tuple[str, ...]] = (f"{PAPER1}, eq. 1 (q)", MCFADDEN)
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("cage_modulation", "impact_scatter")
    deciding_measurement: ClassVar[str] = measurements.LOAD
    features: ClassVar[tuple[str, ...]] = STRENGTH
    draw_weight: ClassVar[float] = 1.6
    inherent_in: ClassVar[tuple[str, ...]] = ("contact",)

    depth: float = parameter(
        0.3, unit="", plausible=(0.05, 1.0), allowed=(0, 1), strength=True, doc="part of the load that a turn changes"
    )
    extent: float = parameter(
        1.0, unit="", plausible=(0.2, 1.0), allowed=(0.05, 1), doc="loaded part of the diameter (Stribeck's epsilon)"
    )
    rotating: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), fitted=False, searched=False,
        doc="whether the load turns with the shaft, as that of an unbalance",
    )  # fmt: skip

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        impacts.amplitudes = impacts.amplitudes * self._weight(draft, impacts.turns, rng)

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.modulate(self._weight(draft, draft.turns, rng))

    def _weight(self, draft: Draft, turns: Array, rng: np.random.Generator) -> Array | float:
        fault, cage = str(draft.condition.fault), draft.bearing.ftf * draft.cage_speed_ratio
        if self.rotating:
            rate = {"outer": 1.0, "ball": 1 - cage}.get(fault)
        else:
            rate = draft.bearing.side_line_order(fault, draft.cage_speed_ratio)
        return 1.0 if rate is None else self._load(rate * turns + rng.random())

    def _load(self, turns: Array) -> Array:
        """Factor on the strength at these angles about the load's direction; of mean 1 over a turn."""
        around = cosine(turns)
        if self.extent >= 1:
            return np.asarray(1 + self.depth * around)
        middle = 2 * self.extent - 1
        edge = math.acos(-middle)  # of the zone; the mean over a turn comes in closed form
        mean = (middle * edge + math.sin(edge)) / math.pi
        return np.asarray(1 + self.depth * (np.maximum(middle + around, 0.0) / mean - 1))

    def forms(self) -> Iterator[Effect]:
        for extent in _EXTENTS:
            for rotating in (False, True):
                yield dataclasses.replace(self, extent=extent, rotating=rotating)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        if not faults(machine) & {"inner", "ball"}:
            return None
        return {"depth": log_uniform(rng, 0.12, 1.0), "extent": 1.0 if rng.random() < 0.4 else rng.uniform(0.25, 1.0)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return PointContactZone(**{**self.parameter_values(), "extent": min(self.extent, rng.uniform(0.25, 0.8))})


@dataclass(frozen=True)
class PointContactZone(LoadZone):
    """Impacts that follow the load of point contacts in its zone (Stribeck's distribution with Hertz's exponent)."""

    def _load(self, turns: Array) -> Array:
        load, mean = (point_contact_load(at, self.extent) for at in (turns, AROUND))
        return np.asarray(1 + self.depth * (load / mean.mean() - 1))
