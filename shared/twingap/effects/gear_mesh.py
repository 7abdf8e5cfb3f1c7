"""Tones of a gear on the shaft."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import TONES
from twingap.effects._references import ISO_13373
from twingap.effects._tones import UnevenHarmonics, speed_dependence, uneven_factors
from twingap.effects.angle import cosine, harmonics
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import tone_level
from twingap.effects.harmonic_series import HarmonicSeries
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register

Array = NDArray[np.float64]


_FEWEST_TEETH: Final = 8
"""Fewest teeth of a gear of which another's mesh is a harmonic. Fewer, and harmonics of the shaft are taken for it."""


@register
@dataclass(frozen=True)
class GearMesh(HarmonicSeries):
    """A gear on the shaft: tones at integer orders (teeth and its harmonics), each with side lines one order away."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = ("Randall 1982, A new method of modeling gear faults", ISO_13373)
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = ("shaft_harmonics", "looseness", "drive_interference", "waviness")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = TONES
    most_harmonics: ClassVar[int] = 6
    regular: ClassVar[frozenset[str]] = frozenset(["decay", "n_harmonics"])
    spaced_by_shaft: ClassVar[bool] = True

    level: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 5.0), log=True, doc="amplitude of the mesh tone"
    )  # fmt: skip
    decay: float = parameter(
        0.5, unit="", plausible=(0.1, 0.9), allowed=(0, 1),
        doc="amplitude of one mesh harmonic over that of the one before",
    )  # fmt: skip
    depth: float = parameter(
        0.5, unit="", plausible=(0.05, 1.5), allowed=(0, 100.0), strength=True,
        doc="modulation: each side line is depth / 2 mesh tones",
    )  # fmt: skip
    teeth: int = parameter(
        23, unit="", plausible=(11, 80), allowed=(1, 100000), exact=True, searched=False, log_estimate=True,
        doc="teeth of the gear on the shaft",
    )  # fmt: skip
    n_harmonics: int = parameter(
        3, unit="", plausible=(1, 6), allowed=(1, 100), fitted=False, doc="number of mesh harmonics"
    )

    @property
    def regular_levels(self) -> Array:
        """[n_harmonics] Amplitude of each mesh tone, healthy rms."""
        return np.asarray(self.level * self.decay ** np.arange(self.n_harmonics))

    def base_hz(self, draft: Draft) -> float:
        return self.teeth * draft.shaft_hz

    def lower(self) -> Iterator[Self]:
        """Gears of a half or a third of the teeth, whose second or third harmonic stands out more than the first."""
        for part in (2, 3):
            if self.teeth % part == 0 and self.teeth // part >= _FEWEST_TEETH:
                levels = np.zeros(part * self.levels.size)
                levels[part - 1 :: part] = self.levels
                yield replace(self, teeth=self.teeth // part).at_levels(levels)

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        levels = draft.reference_rms * self.levels
        phases = rng.random(levels.size)
        # The highest side line lies one order above its mesh harmonic.
        count = math.ceil((draft.condition.fs_hz / 2 / draft.shaft_hz - 1) / self.teeth) - 1
        amplitudes = (levels * np.exp(2j * np.pi * phases))[: max(count, 0)]
        swing = 1 + self.depth * cosine(draft.turns + rng.random())
        draft.x += swing * harmonics(self.teeth * draft.turns, amplitudes.tolist())

    def cannot_act_on(self, draft: Draft) -> str | None:
        return draft.beyond_nyquist((self.teeth + 1) * draft.shaft_hz)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        fastest = max(c.speed_rpm for c in machine.conditions) / 60
        most = int(0.45 * machine.conditions[0].fs_hz / fastest)
        if most < 9:
            return None
        return {
            "level": tone_level(rng, machine, 3.0), "decay": rng.uniform(0.1, 0.9),
            "depth": rng.uniform(0.1, 1.5), "teeth": int(rng.integers(8, min(90, most) + 1)),
            "n_harmonics": int(rng.integers(1, 7)),
        }  # fmt: skip

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        # The median over records lies between a mesh and its double where half of them show either.
        read = [seen.features[f"lines.gear_teeth|{of}.level"] for of in ("all", "healthy", "faulty")]
        read.append(math.exp(seen.features["pooled|gear_teeth"]))
        for teeth in dict.fromkeys(round(one) for one in read if math.isfinite(one)):
            if teeth != self.teeth:
                yield replace(self, teeth=teeth)

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        factors = tuple(uneven_factors(rng).tolist())
        return UnevenGearMesh(**self.parameter_values(), factors=factors, **speed_dependence(machine, rng))


@dataclass(frozen=True)
class UnevenGearMesh(UnevenHarmonics, GearMesh):
    """A mesh whose harmonics are what its teeth make them."""
