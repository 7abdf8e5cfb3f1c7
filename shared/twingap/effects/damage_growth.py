"""Impacts that grow along a run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import measurements
from twingap.effects._fault_effect import FaultEffect
from twingap.effects._features import LEVEL
from twingap.effects._references import PAPER1
from twingap.effects.base import Effect, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.drawing import log_uniform
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register


@register
@dataclass(frozen=True)
class DamageGrowth(FaultEffect):
    """Impacts grow along a run, D = exp(rate (time_s - onset)); 1 before the onset.

    A finished waveform has impacts of one damage, whichever that is: there, D is 1 at the onset and smaller before it.
    Records without `time_s` are not part of a run, and do not change.
    """

    references: ClassVar[tuple[str, ...]] = (f"{PAPER1}, eqs. 1 and 12",)
    group: ClassVar[str] = "operation"
    look_alikes: ClassVar[tuple[str, ...]] = ("speed_gain",)
    deciding_measurement: ClassVar[str] = measurements.ALONG
    features: ClassVar[tuple[str, ...]] = LEVEL
    trends: ClassVar[tuple[str, ...]] = ("on_time",)
    draw_weight: ClassVar[float] = 2.0

    rate_per_s: float = parameter(
        1e-3, unit="1/s", plausible=(1e-6, 1e-2), allowed=(-1.0, 1.0), log=True, strength=True, relative_to="run",
        doc="relative growth per second",
    )  # fmt: skip
    onset_s: float = parameter(
        0.0, unit="s", plausible=(0.0, 1e6), allowed=(-1e12, 1e12), relative_to="run",
        doc="time_s from which the amplitude grows",
    )  # fmt: skip

    def growth(self, draft: Draft) -> float:
        """D of this record."""
        if draft.condition.time_s is None:
            return 1.0
        # exp(50) is beyond any sensor; it only keeps numbers finite.
        return math.exp(min(self.rate_per_s * max(draft.condition.time_s - self.onset_s, 0.0), 50.0))

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        impacts.amplitudes = impacts.amplitudes * self.growth(draft)

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        time_s = draft.condition.time_s
        early = 0.0 if time_s is None else self.rate_per_s * min(time_s - self.onset_s, 0.0)
        draft.modulate(self.growth(draft) * math.exp(max(early, -50.0)))

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        times = [c.time_s for c in machine.conditions if c.time_s is not None and c.fault != "healthy"]
        if len(times) < 4 or max(times) <= min(times):
            return None
        begin, span = min(times), max(times) - min(times)
        onset = begin + span * rng.uniform(0, 0.6) if rng.random() < 0.6 else begin
        return {"rate_per_s": log_uniform(rng, 0.15, 3.0) / (max(times) - onset), "onset_s": onset}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect | None:
        times = [c.time_s for c in machine.conditions if c.time_s is not None]
        if not times or max(times) <= self.onset_s:
            return None
        power = float(rng.choice([0.5, 1.0, 2.0, 4.0]))
        return PowerLawGrowth(**self.parameter_values(), until_s=max(times), power=power)

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        for trend in ("trend|time_impacts", "trend|time_partial", "trend|time_harmonics"):
            growth = seen.features[trend]
            if growth > 0:
                yield self.moved(rate_per_s=growth / seen.span_s, onset_s=seen.begin_s)
                if seen.own_mode is None:
                    yield self.moved(rate_per_s=growth / seen.span_s)


@dataclass(frozen=True)
class PowerLawGrowth(DamageGrowth):
    """Damage that grows with a power of time, to the same end.

    Parameters
    ----------
    until_s : float
        End of the run.
    power : float
    """

    until_s: float = 0.0
    power: float = 1.0

    def growth(self, draft: Draft) -> float:
        """D of this record."""
        span = self.until_s - self.onset_s
        if draft.condition.time_s is None or span <= 0:
            return 1.0
        done = max(draft.condition.time_s - self.onset_s, 0.0) / span
        return float(1 + math.expm1(min(self.rate_per_s * span, 50.0)) * done**self.power)
