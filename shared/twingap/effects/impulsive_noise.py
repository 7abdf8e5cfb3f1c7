"""Random impulses tied to no rotation."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import IMPULSES
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform, secondary_mode
from twingap.effects.machine import Machine
from twingap.effects.modes import Mode, modal_response
from twingap.effects.observations import Observations
from twingap.effects.registry import register

Array = NDArray[np.float64]

LEAST_RATE_HZ: Final = 0.3
"""Added to rates before their logarithm, so that records without impulses have one. A larger value hides rare ones."""
_RATES: Final = (0.06, 0.25, 4.0)
"""Factors on the rate at unchanged power: rare strong impulses and frequent weak ones have one spectrum."""
_EVEN_LEVELS: Final = (0.55, 0.8)
"""Factors on the strength of regular impulses at the estimated rate."""
_EVEN: Final = 0.3
"""Spread of the impulses of one loose part. A larger value tries less regular impulses."""


@register
@dataclass(frozen=True)
class ImpulsiveNoise(Effect):
    """Random impulses tied to no rotation: a Poisson process of gamma-distributed strengths, either sign.

    With a spread of 1 strengths are exponential, as of many causes near and far; one loose part makes them more alike.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Borghesani & Antoni 2017, CS2 analysis in presence of non-Gaussian background noise",
    )
    group: ClassVar[str] = "other sources"
    look_alikes: ClassVar[tuple[str, ...]] = ("foreign_bearing", "impact_scatter", "dropout")
    deciding_measurement: ClassVar[str] = measurements.BACKGROUND
    features: ClassVar[tuple[str, ...]] = IMPULSES
    by_chance: ClassVar[bool] = True

    level: float = parameter(
        15.0, unit="healthy rms", plausible=(2.0, 60.0), log=True, doc="mean amplitude of the response to an impulse"
    )
    rate_hz: float = parameter(
        4.0, unit="1/s", plausible=(0.5, 50.0), allowed=(0, 1e5), log=True, searched=False,
        doc="mean number of impulses per second",
    )  # fmt: skip
    resonance_hz: float = parameter(
        2200.0, unit="Hz", plausible=(300.0, 15000.0), allowed=(1.0, 1e7), log=True, doc="natural frequency of its mode"
    )
    damping_ratio: float = parameter(
        0.06, unit="", plausible=(0.01, 0.3), allowed=(1e-4, 0.99), log=True, doc="damping ratio of its mode"
    )
    spread: float = parameter(
        1.0, unit="", plausible=(0.15, 1.0), allowed=(0, 3.0), searched=False,
        doc="standard deviation of the strengths over their mean",
    )  # fmt: skip

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        mode = Mode(self.resonance_hz, self.damping_ratio, self.level * draft.reference_rms)
        begin, end = -mode.ring_down_s, draft.condition.duration_s
        count = rng.poisson(self.rate_hz * (end - begin))
        times = rng.uniform(begin, end, count)
        draft.x += modal_response([mode], draft.condition.fs_hz, draft.x.size, times, self._strengths(count, rng))

    def _strengths(self, count: int, rng: np.random.Generator) -> Array:
        """[count] Of mean size 1."""
        shape = 1 / max(self.spread, 1e-3) ** 2
        return np.asarray(rng.gamma(shape, 1 / shape, count) * rng.choice((-1.0, 1.0), count))

    def cannot_act_on(self, draft: Draft) -> str | None:
        return draft.beyond_nyquist(self.resonance_hz)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        mode = secondary_mode(rng, machine, (0.03, 0.44), (0.01, 0.25))
        spread = 1.0 if rng.random() < 0.4 else rng.uniform(0.15, 1.0)
        level, rate_hz = log_uniform(rng, 4.0, 60.0), log_uniform(rng, 0.7, 40.0)
        return {"level": level, "rate_hz": rate_hz, "spread": spread, **mode}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        even = rng.uniform(0.2, 0.9)
        return EvenImpulses(**self.parameter_values(), even=even, one_sided=bool(rng.random() < 0.4))

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        for of in ("all", "healthy"):
            yield from self._counted(seen, of)
        modes = [self]
        if seen.own_mode is not None:
            resonance_hz, damping_ratio = seen.own_mode
            modes.append(dataclasses.replace(self, resonance_hz=resonance_hz, damping_ratio=damping_ratio))
            yield modes[1]
        for one in modes:
            for factor in _RATES:
                rarer = {"rate_hz": factor * self.rate_hz, "level": self.level / math.sqrt(factor)}
                yield dataclasses.replace(one, **rarer)
            for factor in _EVEN_LEVELS:
                yield dataclasses.replace(one, level=factor * self.level, spread=_EVEN)

    def _counted(self, seen: Observations, of: str) -> Iterator[ImpulsiveNoise]:
        """Initial values from the counted impulses, and from the count corrected for those hidden in noise."""
        level, place, damping = (
            seen.features[f"background.impulse_{what}|{of}.level"] for what in ("level", "fs", "damping_log")
        )
        for counted in ("count_log", "rate_log"):
            rate_hz = 10 ** seen.features[f"background.impulse_{counted}|{of}.level"] - LEAST_RATE_HZ
            if min(rate_hz, place) > 0 and math.isfinite(level + damping):
                for spread, louder in ((1.0, 1.0), (_EVEN, 2.0)):
                    yield self.moved(
                        level=louder * 10**level, rate_hz=rate_hz, spread=spread,
                        resonance_hz=min(place, 0.48) * seen.fs_hz, damping_ratio=10**damping,
                    )  # fmt: skip


@dataclass(frozen=True)
class EvenImpulses(ImpulsiveNoise):
    """Impulses that have a part of their strength in common, or all the same sign.

    Parameters
    ----------
    even : float
        Part of the strength that all have.
    one_sided : bool
    """

    even: float = 0.0
    one_sided: bool = False

    def _strengths(self, count: int, rng: np.random.Generator) -> Array:
        own = super()._strengths(count, rng)
        sides = np.ones(count) if self.one_sided else np.sign(own)
        return np.asarray((self.even + (1 - self.even) * np.abs(own)) * sides)
