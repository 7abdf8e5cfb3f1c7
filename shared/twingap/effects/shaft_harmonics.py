"""Tones at multiples of shaft speed, from unbalance and misalignment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._faint_lines import lacks_faint_lines
from twingap.effects._features import TONES
from twingap.effects._references import ISO_13373, RANDALL_BOOK
from twingap.effects._tones import UnevenHarmonics, add_harmonics, speed_dependence, uneven_factors
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import tone_level
from twingap.effects.harmonic_series import MeasuredLines
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register

Array = NDArray[np.float64]

_FAINT: Final = 5.0
"""z of faint lines from which they are harmonics of the shaft: fewer than one in 100 machines without have some."""
_BEYOND_DOUBT: Final = 6.0
"""The same where nothing else shows a gap. A smaller value finds fainter lines, and gives more false alarms."""
_HALF_ORDERS: Final = 4.0
"""z of half orders from which whole orders are those of a loose part. A larger value takes them for the shaft's."""
_UNSEEN: Final = 1e-3
"""Amplitude, healthy rms, of a harmonic that records do not show: levels are positive."""


@register
@dataclass(frozen=True)
class ShaftHarmonics(MeasuredLines):
    """Tones at 1, 2 and 3 times shaft speed (unbalance, misalignment): they survive synchronous averaging.

    Phases are random from record to record, since records start at no particular shaft angle.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (ISO_13373, RANDALL_BOOK)
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = ("looseness", "gear_mesh", "mains_interference")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = TONES
    most_harmonics: ClassVar[int] = 3

    level_1x: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 5.0), log=True, doc="amplitude at shaft speed (unbalance)"
    )
    level_2x: float = parameter(
        0.3, unit="healthy rms", plausible=(0.01, 5.0), log=True, doc="amplitude at twice shaft speed (misalignment)"
    )
    level_3x: float = parameter(
        0.15, unit="healthy rms", plausible=(0.005, 5.0), log=True, doc="amplitude at three times shaft speed"
    )

    @property
    def levels(self) -> Array:
        """[3] Amplitude of each, healthy rms."""
        return np.array([self.level_1x, self.level_2x, self.level_3x])

    def at_levels(self, levels: Array) -> Self:
        found = {f"level_{k}x": max(float(level), _UNSEEN) for k, level in enumerate(levels, start=1)}
        return replace(self, **found)

    def base_hz(self, draft: Draft) -> float:
        return draft.shaft_hz

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        add_harmonics(draft, draft.turns, draft.shaft_hz, self.levels, rng.random(3))

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        strongest = tone_level(rng, machine, 1.5)
        levels = strongest * 10 ** (-rng.uniform(0, 12, 3) / 20)
        levels[rng.integers(3)] = strongest
        return {f"level_{k}x": float(level) for k, level in enumerate(levels, start=1)}

    @classmethod
    def certain(cls, seen: Observations) -> bool:
        """Where all records share faint lines at whole orders and none at half orders, and the twin's do not."""
        return cls._has(seen, _FAINT)

    @classmethod
    def shows_gap(cls, seen: Observations) -> bool:
        return cls._has(seen, _BEYOND_DOUBT)

    @classmethod
    def _has(cls, seen: Observations, least: float) -> bool:
        """Whether there are such lines of at least this z."""
        loose = seen.features.get("pooled|faint_shaft_half", 0.0) >= _HALF_ORDERS
        return not loose and lacks_faint_lines(seen, "shaft", least, clear="pooled|order_few")

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        factors = tuple(uneven_factors(rng).tolist())
        return SpeedDependentHarmonics(**self.parameter_values(), factors=factors, **speed_dependence(machine, rng))


@dataclass(frozen=True)
class SpeedDependentHarmonics(UnevenHarmonics, ShaftHarmonics):
    """Forces of unbalance and misalignment, which grow with speed."""
