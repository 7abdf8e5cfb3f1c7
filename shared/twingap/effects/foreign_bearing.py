"""Impacts from another bearing."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import IMPULSES
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.angle import cosine
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform, secondary_mode
from twingap.effects.impact_train import responses
from twingap.effects.machine import Machine
from twingap.effects.modes import Mode, modal_response
from twingap.effects.observations import Observations
from twingap.effects.registry import register

Array = NDArray[np.float64]

_ORDERS: Final = ("lines.comb_order|all", "background.foreign_order|all", "background.foreign_order|healthy")
"""Features that estimate the order of the impacts."""
_SAME_ORDER: Final = 0.003
"""Relative difference of two estimates of the order below which a search begins at one of them alone."""
_LEVELS: Final = (1.25, 0.8, 0.5)
"""Factors on the level at which the path of this bearing is tried. More factors cost two simulations each for every
order."""
_SLIP: Final = 0.0025
"""Spread of spacings that is tried beside even ones, as of rollers that slip. A larger value suits looser cages."""


@register
@dataclass(frozen=True)
class ForeignBearing(Effect):
    """Another bearing's fault: impacts at an order that is not this bearing's.

    They ring in a mode of their own, or with `own_path` as the impacts of this bearing do.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (RANDALL_ANTONI,)
    group: ClassVar[str] = "other sources"
    look_alikes: ClassVar[tuple[str, ...]] = ("impulsive_noise", "gear_mesh", "mean_slip")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = (
        *IMPULSES, "pooled|foreign*", "lines.free_*", "background.modulation_*", "background.rough_*",
    )  # fmt: skip
    draw_weight: ClassVar[float] = 1.2

    level: float = parameter(
        5.0, unit="healthy rms", plausible=(0.5, 20.0), log=True, doc="amplitude of the response to an impact"
    )
    order: float = parameter(
        4.37, unit="orders", plausible=(2.0, 12.0), allowed=(1e-3, 1e4), exact=True, searched=False,
        doc="impacts per turn of this shaft",
    )  # fmt: skip
    resonance_hz: float = parameter(
        2500.0, unit="Hz", plausible=(500.0, 15000.0), allowed=(1.0, 1e7), log=True, doc="natural frequency of its mode"
    )
    damping_ratio: float = parameter(
        0.05, unit="", plausible=(0.01, 0.2), allowed=(1e-4, 0.99), log=True, doc="damping ratio of its mode"
    )
    sigma: float = parameter(
        0.0, unit="impact spacings", plausible=(0.0, 0.015), allowed=(0, 0.5), searched=False,
        doc="standard deviation of the spacing of its impacts as its rollers slip; deviations accumulate",
    )  # fmt: skip
    own_path: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), searched=False,
        doc="whether its impacts take the path of this bearing's, where that is known, in place of a mode",
    )  # fmt: skip

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        modes, response = [Mode(self.resonance_hz, self.damping_ratio)], None
        if self.own_path and draft.excitation == "impacts":
            modes = draft.modes
        elif self.own_path:
            response = draft.force_response()
        passes = draft.turns[-1] * self.order
        late = math.ceil(4 * self.sigma * math.sqrt(passes))  # slip may move as many impacts out of the record
        before = math.ceil(max(mode.ring_down_s for mode in modes) * draft.shaft_hz * self.order) + 1 + late
        count = np.arange(-before, math.ceil(passes) + 1 + late)
        turns = (count + rng.random()) / self.order
        turns, strengths = self._impacts(turns, rng)
        times, fs_hz, n = draft.when(turns), draft.condition.fs_hz, draft.x.size
        level = self.level * draft.reference_rms
        if response is None:
            draft.x += modal_response(modes, fs_hz, n, times, level * strengths)
        else:
            draft.x += responses(times * fs_hz, level * strengths, response, n)

    def _impacts(self, turns: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Shaft angles and strengths of impacts that would come evenly, at these angles, and alike."""
        if self.sigma > 0:
            turns = turns + np.cumsum(self.sigma / self.order * rng.standard_normal(turns.size))
        return turns, np.ones(turns.size)

    @property
    def idle_parameters(self) -> frozenset[str]:
        """See `Effect.idle_parameters`."""
        return frozenset({"resonance_hz", "damping_ratio"} if self.own_path else ())

    def cannot_act_on(self, draft: Draft) -> str | None:
        return draft.beyond_nyquist(self.resonance_hz)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        mode = secondary_mode(rng, machine, (0.04, 0.44), (0.01, 0.15))
        return {"level": log_uniform(rng, 0.8, 20.0), "order": rng.uniform(1.3, 13.0), **mode}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return SlippingForeignBearing(**self.parameter_values(), jitter=0.02 * rng.random(), depth=rng.uniform(0, 0.8))

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        read = [part[f"{place}.level"] for part in (seen.features, seen.held_out) for place in _ORDERS]
        kept = [self.order]
        for order in (*read, math.exp(seen.features["pooled|foreign_order"])):
            if order > 0 and all(abs(order / other - 1) > _SAME_ORDER for other in kept):
                kept.append(order)
                place = self.moved(order=order)
                # A level that was estimated for another order would be too much.
                yield from (place, *place.weaker())
        for order, factor, sigma in product(kept, _LEVELS, (0.0, _SLIP)):
            # The level that was estimated is that of another mode.
            yield dataclasses.replace(self, order=order, own_path=True, level=factor * self.level, sigma=sigma)


@dataclass(frozen=True)
class SlippingForeignBearing(ForeignBearing):
    """A neighbour whose rollers slip and pass through its own load zone.

    Parameters
    ----------
    jitter : float
        Of impacts about their places, spacings.
    depth : float
        Half the swing of strengths over a turn of the shaft.
    """

    jitter: float = 0.0
    depth: float = 0.0

    def _impacts(self, turns: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        turns, _ = super()._impacts(turns, rng)
        strengths = 1 + self.depth * cosine(turns + rng.random())
        return turns + self.jitter / self.order * rng.standard_normal(turns.size), strengths
