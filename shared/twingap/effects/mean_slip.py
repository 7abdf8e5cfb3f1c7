"""Slip of the cage against its kinematic speed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from twingap.effects import measurements
from twingap.effects._features import CLARITY_OF_IMPACTS
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register
from twingap.records import Record, RecordSet
from twingap.signal.impact_rate import rate_ratio

_STRIKING: Final = ("inner", "outer", "ball")
"""Faults whose impacts show the speed of the cage."""


@register
@dataclass(frozen=True)
class MeanSlip(Effect):
    """The cage runs slower (or, from a changed contact angle, faster) than its kinematic speed.

    BPFO and BPFI change in opposite directions and their sum stays Z; see `Bearing.slipped`. Lines stay sharp. The
    rollers' spin does not follow from the cage: they may roll on the inner ring, roll on the outer one, or slide.
    """

    stage: ClassVar[Stage] = Stage.SHAFT
    references: ClassVar[tuple[str, ...]] = (RANDALL_ANTONI,)
    group: ClassVar[str] = "kinematics"
    look_alikes: ClassVar[tuple[str, ...]] = ("speed_fluctuation", "foreign_bearing")
    deciding_measurement: ClassVar[str] = measurements.TACHO
    features: ClassVar[tuple[str, ...]] = (
        *CLARITY_OF_IMPACTS, "impacts.rate_log_ratio", "impacts.shaft_log_ratio", "lines.*_ratio_log",
        "lines.shaft_lock", "lines.wave_*_score", "lines.fault_comb_*", "context|slip*", "context|speed*",
        "impacts.wander_log",
    )  # fmt: skip
    draw_weight: ClassVar[float] = 2.0

    slip: float = parameter(
        0.01, unit="", plausible=(-0.03, 0.03), allowed=(-0.2, 0.2), strength=True,
        doc="part by which the cage lags its kinematic speed",
    )  # fmt: skip
    of_rollers: float = parameter(
        1.0, unit="", plausible=(-1.5, 1.0), allowed=(-3.0, 3.0),
        doc="part of the slip by which a roller's spin moves; 1 rolls on the inner ring, as all contact dynamics do",
    )  # fmt: skip

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.cage_speed_ratio *= 1 - self.slip
        # Contact dynamics compute the rollers' spin themselves.
        draft.spin_share = 1.0 if draft.excitation == "rollers" else self.of_rollers

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation == "waveform":
            return "in a finished waveform, components of cage and shaft cannot be separated"
        return None

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        # A single fault shows it only if tones or side lines show the shaft's rate.
        if not faults(machine):
            return None
        other = rng.choice([-1.0, 0.0, rng.uniform(-1.5, 0.5)])
        return {
            "slip": float(rng.choice([-1, 1])) * log_uniform(rng, 0.003, 0.06),
            "of_rollers": 1.0 if rng.random() < 0.6 else float(other),
        }

    @classmethod
    def read_off_unit(cls, records: RecordSet, simulated: Iterable[Record]) -> Mapping[str, float]:
        fault = str(records.conditions[0].fault)
        if records.bearing is None or fault not in _STRIKING:
            return {}
        # Fault orders are linear in the cage's speed.
        still, kinematic = (records.bearing.slipped(cage)[fault] for cage in (0.0, 1.0))
        if not math.isfinite(ratio := rate_ratio(records, kinematic)):
            return {}
        return {"slip": (1 - ratio) * kinematic / (kinematic - still), "of_rollers": 1.0}

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        slip = seen.features["context|slip_measured"]
        if math.isfinite(slip):
            for share in (1.0, 0.0, seen.features["context|slip_rollers"]):
                if math.isfinite(share):
                    yield self.moved(slip=slip, of_rollers=share)
