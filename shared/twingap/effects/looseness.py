"""Shaft harmonics and half orders of a loose part."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import TONES
from twingap.effects._references import ISO_13373, RANDALL_BOOK
from twingap.effects._tones import UnevenHarmonics, add_harmonics, speed_dependence, uneven_factors
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import tone_level
from twingap.effects.harmonic_series import HarmonicSeries
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register
from twingap.effects.subsynchronous import shared_line

Array = NDArray[np.float64]

_NEAR_HALF: Final = 0.1
"""Distance from half the shaft's order within which a line can be taken for a loose part's. With a larger value, a belt
rules out a loose part beside it."""


@register
@dataclass(frozen=True)
class Looseness(HarmonicSeries):
    """Mechanical looseness: many shaft harmonics, and half orders between them.

    Order m = 1/2, 1, 3/2, ... up to `n_orders` has amplitude level decay^(m - 1), half orders times `half_ratio`. The
    harmonics are in phase once every two turns, as a hammering part makes them, or come with phases of their own,
    random from record to record, as a path of many modes leaves them.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (ISO_13373, RANDALL_BOOK)
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = ("shaft_harmonics", "gear_mesh", "impulsive_noise")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = TONES
    most_harmonics: ClassVar[int] = 40
    regular: ClassVar[frozenset[str]] = frozenset(["decay", "half_ratio", "n_orders"])

    level: float = parameter(
        0.3, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude at shaft speed"
    )  # fmt: skip
    decay: float = parameter(
        0.85, unit="", plausible=(0.5, 0.98), allowed=(0.05, 1),
        doc="amplitude of one order over that of the one before",
    )  # fmt: skip
    half_ratio: float = parameter(
        0.6, unit="", plausible=(0.1, 1.5), allowed=(0, 100), doc="half orders over the trend of integer orders"
    )
    n_orders: int = parameter(
        10, unit="", plausible=(5, 20), allowed=(1, 200), fitted=False, doc="highest order"
    )  # fmt: skip
    in_phase: bool = parameter(
        True, unit="", plausible=(0, 1), allowed=(0, 1),
        doc="whether all orders are in phase once every two turns, as an impact makes them",
    )  # fmt: skip

    @property
    def regular_levels(self) -> Array:
        """[2 n_orders] Amplitude of each half order, healthy rms."""
        half = np.arange(1, 2 * self.n_orders + 1)
        return self.level * self.decay ** (half / 2 - 1) * np.where(half % 2, self.half_ratio, 1.0)

    def base_hz(self, draft: Draft) -> float:
        return draft.shaft_hz / 2

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        levels = self.levels
        phases = np.arange(1, levels.size + 1) * rng.random() if self.in_phase else rng.random(levels.size)
        add_harmonics(draft, draft.turns / 2, draft.shaft_hz / 2, levels, phases)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {
            "level": tone_level(rng, machine, 1.2), "decay": rng.uniform(0.6, 0.97),
            "half_ratio": rng.uniform(0.25, 1.0), "n_orders": int(rng.integers(5, 18)),
            "in_phase": bool(rng.random() < 0.5),
        }  # fmt: skip

    @classmethod
    def excluded(cls, seen: Observations) -> bool:
        """Where all records share a line near half the shaft's order that is not at it: a whirl, or a belt."""
        line = shared_line(seen)
        return line is not None and abs(line.order - 0.5) < _NEAR_HALF and not line.is_at(0.5)

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        factors = tuple(uneven_factors(rng).tolist())
        return UnevenLooseness(**self.parameter_values(), factors=factors, **speed_dependence(machine, rng))

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        for factor in (1.0, 2.0, 4.0):
            yield dataclasses.replace(self, level=factor * self.level, in_phase=not self.in_phase)


@dataclass(frozen=True)
class UnevenLooseness(UnevenHarmonics, Looseness):
    """Orders that resonances on their way raise and lower."""
