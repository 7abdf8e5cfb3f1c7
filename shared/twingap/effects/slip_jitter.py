"""Random variation of the impact spacing."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._fault_effect import FaultEffect, by_pass, passes_within
from twingap.effects._features import TIMING
from twingap.effects._references import PAPER1
from twingap.effects.base import Effect, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class SlipJitter(FaultEffect):
    """Impacts have random angular deviations from their places, or random spacings that accumulate.

    Not accumulating (tau_i of eq. 1 of paper 1): sharp lines whose harmonic n falls as exp(-(2 pi n sigma)^2 / 2), and
    a raised floor. Accumulating (D'Elia & Cocconcelli's public code, random slip of the cage): lines broaden as n^2.

    On rollers the roller train is delayed by `sigma` roller spacings, on a finished waveform the waveform by `sigma`
    impact spacings; between passes the delay runs evenly, so the resonance of a waveform wavers by about `sigma`.
    """

    references: ClassVar[tuple[str, ...]] = (
        f"{PAPER1}, eqs. 1 and 2",
        "Antoni 2007, Cyclic spectral analysis of rolling-element bearing signals: facts and fictions",
        "D'Elia & Cocconcelli, public code for simulated bearing signals (accumulating slip)",
    )
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("speed_fluctuation", "impact_scatter")
    deciding_measurement: ClassVar[str] = measurements.TACHO
    features: ClassVar[tuple[str, ...]] = TIMING
    draw_weight: ClassVar[float] = 1.6
    irregular_impacts: ClassVar[tuple[Mapping[str, Mapping[str, float]], ...]] = (
        {"slip_jitter": {"sigma": 0.01}},
        {"slip_jitter": {"sigma": 0.01}, "impact_scatter": {"sigma": 0.2}},
    )

    sigma: float = parameter(
        0.02, unit="impact spacings", plausible=(0.002, 0.1), allowed=(0, 0.5), log=True, strength=True,
        doc="standard deviation of the spacing",
    )  # fmt: skip
    accumulating: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), fitted=False, exact=True,
        doc="whether random spacings accumulate, rather than deviations from places",
    )  # fmt: skip

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        places, count = by_pass(impacts)
        late = self.sigma / draft.fault_order * self._lateness(count, rng)
        if self.accumulating:
            # The roller train itself moves, so that weights by shaft angle have to see it.
            impacts.turns = impacts.turns + np.cumsum(late)[places]
        else:
            impacts.delays = late[places] if impacts.delays is None else impacts.delays + late[places]

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        at, known = passes_within(draft, rng)
        late = self._lateness(at.size, rng)
        # Interpolation at a random place between two independent draws reduces the variance to 2/3.
        late = np.cumsum(late) if self.accumulating else (1.0 if known else math.sqrt(1.5)) * late
        # A train that is late by one roller spacing is late by 1 / BPFO shaft turns.
        order = draft.fault_order
        if draft.excitation == "rollers":
            order = draft.bearing.slipped(draft.cage_speed_ratio)["outer"]
        draft.delay(np.interp(draft.turns, at, self.sigma / order * late))

    def _lateness(self, count: int, rng: np.random.Generator) -> Array:
        """[count] Of variance 1."""
        return rng.standard_normal(count)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        if not faults(machine):
            return None
        return {"sigma": log_uniform(rng, 0.005, 0.1), "accumulating": bool(rng.random() < 0.3)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return NonGaussianJitter(**self.parameter_values(), even=bool(rng.random() < 0.5))

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        # In a random walk, impacts a little apart differ less, and those far apart more.
        for factor in (1.0, 0.5, 0.25):
            yield dataclasses.replace(self, sigma=factor * self.sigma, accumulating=not self.accumulating)


@dataclass(frozen=True)
class NonGaussianJitter(SlipJitter):
    """Uniform or Laplacian rather than normal deviations.

    Parameters
    ----------
    even : bool
    """

    even: bool = True

    def _lateness(self, count: int, rng: np.random.Generator) -> Array:
        return rng.uniform(-1, 1, count) * math.sqrt(3) if self.even else rng.laplace(size=count) / math.sqrt(2)
