"""Tones of wavy races."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import TONES
from twingap.effects._tones import UnevenHarmonics, add_harmonics, speed_dependence, uneven_factors
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import tone_level
from twingap.effects.harmonic_series import HarmonicSeries
from twingap.effects.machine import Machine
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class Waviness(HarmonicSeries):
    """Wavy races: sinusoids at multiples of the ball-pass order, following the shaft angle and the cage's slip.

    In every record, healthy or not. Lines in the raw spectrum; the envelope of a resonance band does not show them.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Harsha, Sandeep & Prakash 2003, The effect of speed of balanced rotor on nonlinear vibrations associated with "
        "ball bearings",
        "Yhland 1992, A linear theory of vibrations caused by ball bearings with form errors",
    )
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = ("gear_mesh", "drive_interference")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = TONES
    most_harmonics: ClassVar[int] = 10
    regular: ClassVar[frozenset[str]] = frozenset(["decay", "n_harmonics"])

    level: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude at the ball-pass order"
    )
    decay: float = parameter(
        0.6, unit="", plausible=(0.2, 0.95), allowed=(0, 1), doc="amplitude of one multiple over that of the one before"
    )
    n_harmonics: int = parameter(
        4, unit="", plausible=(1, 10), allowed=(1, 100), fitted=False, doc="number of multiples"
    )
    inner: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), fitted=False, exact=True,
        doc="whether the inner race is wavy (BPFI) and not the outer one (BPFO)",
    )  # fmt: skip

    @property
    def regular_levels(self) -> Array:
        """[n_harmonics] Amplitude at each multiple, healthy rms."""
        return np.asarray(self.level * self.decay ** np.arange(self.n_harmonics))

    def base_hz(self, draft: Draft) -> float:
        return self._order(draft) * draft.shaft_hz

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        order, levels = self._order(draft), self.levels
        add_harmonics(draft, order * draft.turns, order * draft.shaft_hz, levels, rng.random(levels.size))

    def _order(self, draft: Draft) -> float:
        """Order of the ball passes."""
        return draft.bearing.slipped(draft.cage_speed_ratio)["inner" if self.inner else "outer"]

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {
            "level": tone_level(rng, machine, 2.0), "decay": rng.uniform(0.2, 0.95),
            "n_harmonics": int(rng.integers(1, 8)), "inner": bool(rng.random() < 0.35),
        }  # fmt: skip

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        factors = tuple(uneven_factors(rng).tolist())
        return UnevenWaviness(**self.parameter_values(), factors=factors, **speed_dependence(machine, rng))


@dataclass(frozen=True)
class UnevenWaviness(UnevenHarmonics, Waviness):
    """Races whose waves are what grinding made them."""
