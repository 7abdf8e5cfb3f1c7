"""Random variation of the impacts' strength."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._fault_effect import FaultEffect, by_pass, passes_within
from twingap.effects._features import STRENGTH
from twingap.effects._references import PAPER1
from twingap.effects.base import Effect, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register

Array = NDArray[np.float64]

_BEFORE: Final = 0.3
"""Part of a pass before the centre of an impact's energy at which the gain changes to the next impact's."""


@register
@dataclass(frozen=True)
class ImpactScatter(FaultEffect):
    """Impacts have random, independent strengths of mean 1 (lognormal, so always positive).

    Raises the floor of the envelope spectrum; its harmonics keep their width. On a finished waveform whose impacts
    stand out a gain of each; on rollers and other waveforms one that runs evenly from pass to pass, of the same
    variance at a pass.
    """

    references: ClassVar[tuple[str, ...]] = (f"{PAPER1}, eqs. 1 and 2 (A_i)",)
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("slip_jitter", "load_zone", "cage_modulation")
    deciding_measurement: ClassVar[str] = measurements.LONGER
    features: ClassVar[tuple[str, ...]] = STRENGTH
    draw_weight: ClassVar[float] = 1.6
    irregular_impacts: ClassVar[tuple[Mapping[str, Mapping[str, float]], ...]] = ({"impact_scatter": {"sigma": 0.1}},)

    sigma: float = parameter(
        0.2, unit="", plausible=(0.02, 1.0), allowed=(0, 5.0), log=True, strength=True,
        doc="standard deviation of the strength over its mean",
    )  # fmt: skip

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        places, count = by_pass(impacts)
        impacts.amplitudes = impacts.amplitudes * self._strengths(count, self.sigma, rng)[places]

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        at, known = passes_within(draft, rng)
        if known:  # the gain changes between two impacts, shortly before the later one, and is late where that is
            turns = draft.turns if draft.cage_lag is None else draft.turns - draft.cage_lag
            own = np.searchsorted(at - _BEFORE * (at[1] - at[0]), turns) - 1
            draft.modulate(self._strengths(at.size, self.sigma, rng)[own])
            return
        # The variance that interpolating leaves, as for jitter.
        draft.modulate(np.interp(draft.turns, at, self._strengths(at.size, math.sqrt(1.5) * self.sigma, rng)))

    @staticmethod
    def _strengths(count: int, sigma: float, rng: np.random.Generator) -> Array:
        spread = math.sqrt(math.log1p(sigma**2))
        return np.exp(spread * rng.standard_normal(count) - spread**2 / 2)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        return {"sigma": log_uniform(rng, 0.1, 1.0)} if faults(machine) else None

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return GammaScatter(**self.parameter_values())


@dataclass(frozen=True)
class GammaScatter(ImpactScatter):
    """Strengths of a gamma distribution: many weak ones, few strong ones."""

    @staticmethod
    def _strengths(count: int, sigma: float, rng: np.random.Generator) -> Array:
        return rng.gamma(1 / sigma**2, sigma**2, count)
