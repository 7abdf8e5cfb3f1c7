"""A fixed carrier with side lines tied to shaft speed, from a variable-speed drive or motor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from twingap.effects import measurements
from twingap.effects._faint_lines import SIDES, lacks_faint_lines
from twingap.effects._features import TONES
from twingap.effects.angle import cosine
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform, tone_level
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register

CERTAIN_PAIR: Final = 8.0
"""z of a pair of lines without a line between them from which it is a drive's: fewer than one in 200 machines without a
drive have one. A smaller value takes chance pairs of gears and of other bearings for a drive."""
_SHOWN: Final = math.log1p(5.0)
"""Compressed z of such a pair from which the drive's values are read off it. A smaller value reads fainter pairs, some
of them by chance."""
_SHARED: Final = 0.9
"""Least part of the records that such a pair is symmetric in. A smaller value takes lines of another bearing for it."""
_SPEEDS: Final = math.log(1.03)
"""Least logarithm of the highest over the lowest speed for such a pair. A smaller value takes lines of gears for it."""
_FAINT: Final = 6.5
"""z of faint side lines from which they are a drive's: fewer than one in 100 machines without a drive have some."""
_BEYOND_DOUBT: Final = 7.0
"""The same where nothing else shows a gap. A smaller value finds fainter lines, and gives more false alarms."""
_FAINTEST: Final = 5.5
"""z of faint side lines from which the drive's values are read off them."""
_OTHER_BEARING: Final = 3.0
"""Score of another bearing's envelope lines from which side lines at its spacing are its own. A smaller value takes
drives for it."""
_SAME_ORDER: Final = 0.01
"""Relative error of its order, and of the distance of side lines. A larger value has more drives taken for it."""
_OF_SIDES: Final = ("", "_rival", "_own", "_fs", "_order", "_level", "_own_level")
_OWN_LINE: Final = 3.0
"""z of a line at the carrier from which its amplitude is known."""
_SUPPRESSED: Final = 50.0
"""Depth of modulation of a carrier without a line of its own. A larger value leaves less of the carrier."""


@register
@dataclass(frozen=True)
class DriveInterference(Effect):
    """Variable-speed drive or motor: a fixed carrier with a pair of lines about it, at a multiple of shaft speed."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Smith & Randall 2015, Rolling element bearing diagnostics using the Case Western Reserve University data: a "
        "benchmark study (electromagnetic interference of the drive)",
    )
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = ("mains_interference", "gear_mesh", "waviness")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = TONES

    level: float = parameter(0.5, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude of the carrier")
    depth: float = parameter(
        1.0, unit="", plausible=(0.1, 2.0), allowed=(0, 100.0), strength=True,
        doc="modulation: each side line is depth / 2 carriers",
    )  # fmt: skip
    carrier_hz: float = parameter(
        4000.0, unit="Hz", plausible=(500.0, 16000.0), allowed=(1.0, 1e7), log=True, exact=True, searched=False,
        doc="carrier frequency",
    )  # fmt: skip
    sideband_order: float = parameter(
        2.0, unit="orders", plausible=(1.0, 8.0), allowed=(1e-3, 1e3), exact=True, searched=False,
        doc="distance of the side lines from the carrier",
    )  # fmt: skip

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        phases = rng.random(2)
        carrier = cosine(self.carrier_hz * draft.t + phases[0])
        carrier *= 1 + self.depth * cosine(self.sideband_order * draft.turns + phases[1])
        draft.x += self.level * draft.reference_rms * carrier

    def cannot_act_on(self, draft: Draft) -> str | None:
        return draft.beyond_nyquist(self.carrier_hz + self.sideband_order * draft.shaft_hz)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        fs_hz = machine.conditions[0].fs_hz
        order = float(rng.integers(1, 9)) if rng.random() < 0.7 else rng.uniform(1, 8)
        return {
            "level": tone_level(rng, machine, 2.0), "depth": rng.uniform(0.2, 2.0),
            "carrier_hz": fs_hz * log_uniform(rng, 0.04, 0.46), "sideband_order": order,
        }  # fmt: skip

    @classmethod
    def certain(cls, seen: Observations) -> bool:
        """Where the records have a certain pair of lines without a line between them, or faint side lines of a carrier,
        and the twin has none."""
        pair = seen.features["pooled|pair"]
        clear = pair > math.log1p(CERTAIN_PAIR) > pair - seen.features["pooled|pair.diff"]
        # At one speed, lines of a gear or of another bearing are such a pair, too.
        clear = clear and seen.features["context|speeds"] > _SPEEDS and seen.features["pooled|pair_part"] >= _SHARED
        clear = clear and not _of_another_bearing(seen, seen.features["pooled|pair_side_order"])
        return clear or cls._lacks_faint_sides(seen, _FAINT)

    @classmethod
    def shows_gap(cls, seen: Observations) -> bool:
        return cls._lacks_faint_sides(seen, _BEYOND_DOUBT)

    @classmethod
    def _lacks_faint_sides(cls, seen: Observations, least: float) -> bool:
        """Whether the records have faint side lines of at least this z, none of another bearing, and the twin none."""
        other = _of_another_bearing(seen, seen.features.get("pooled|faint_sides_order", math.nan))
        return lacks_faint_lines(seen, SIDES, least) and not other

    @classmethod
    def shown(cls, seen: Observations) -> Mapping[str, float]:
        """Both lines, where they are clearer than a carrier with two lines, or too faint for it."""
        if not seen.features["pooled|pair"] >= max(_SHOWN, seen.features["pooled|carrier_balance"]):
            return cls._shown_faintly(seen) if seen.features["pooled|carrier_balance"] < _SHOWN else {}
        amplitude = math.exp(seen.features["pooled|pair_level"])
        return {
            "level": 2 * amplitude / _SUPPRESSED, "depth": _SUPPRESSED,
            "carrier_hz": math.exp(seen.features["pooled|pair_fs"]) * seen.fs_hz,
            "sideband_order": seen.features["pooled|pair_side_order"],
        }  # fmt: skip

    @classmethod
    def _shown_faintly(cls, seen: Observations) -> Mapping[str, float]:
        """Faint side lines and their carrier, where they exceed those by chance."""
        found = {name: seen.features.get(f"pooled|faint_sides{name}", math.nan) for name in _OF_SIDES}
        if not found[""] > max(found["_rival"] + 1, _FAINTEST):
            return {}
        side = math.exp(found["_level"])
        carrier = math.exp(found["_own_level"]) if found["_own"] > _OWN_LINE else 2 * side / _SUPPRESSED
        return {
            "level": carrier, "depth": 2 * side / carrier, "carrier_hz": math.exp(found["_fs"]) * seen.fs_hz,
            "sideband_order": found["_order"],
        }  # fmt: skip

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        second = 0.0 if rng.random() < 0.5 or self.depth > 1.2 else rng.uniform(0.2, 0.7)
        return PhaseModulatedDrive(**self.parameter_values(), second=second)


def _of_another_bearing(seen: Observations, side_order: float) -> bool:
    """Whether lines this far from their centre are as far from each other as lines of another bearing's impacts.

    Of the centres between these many lines, some are by chance at the same frequency at two or three speeds.
    """
    if not (seen.features["pooled|foreign"] > _OTHER_BEARING and math.isfinite(side_order)):
        return False
    order = math.exp(seen.features["pooled|foreign_order"])
    spacings = 2 * side_order / order
    # A drive's own side lines give the envelope a line at a whole order.
    turning = abs(order / max(round(order), 1) - 1) < _SAME_ORDER
    return not turning and abs(spacings - round(spacings)) < _SAME_ORDER * spacings


@dataclass(frozen=True)
class PhaseModulatedDrive(DriveInterference):
    """A carrier whose phase swings, or with two pairs of side lines, rather than one that swells as a cosine.

    Parameters
    ----------
    second : float
        Side lines of the second pair over those of the first; 0 is a carrier whose phase swings.
    """

    second: float = 0.0

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        carrier, side = self.carrier_hz * draft.t + rng.random(), self.sideband_order * draft.turns + rng.random()
        if self.second:
            wave = cosine(carrier) * (1 + self.depth * (cosine(side) + self.second * cosine(2 * side + rng.random())))
        else:
            wave = cosine(carrier + self.depth / (2 * np.pi) * cosine(side))
        draft.x += self.level * draft.reference_rms * wave
