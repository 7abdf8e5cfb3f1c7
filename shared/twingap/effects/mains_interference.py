"""Hum of the mains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._faint_lines import lacks_faint_lines
from twingap.effects._features import TONES
from twingap.effects._references import RANDALL_BOOK
from twingap.effects._tones import (
    FEWEST,
    RESOLVED,
    UnevenHarmonics,
    add_harmonics,
    common_levels,
    resolved_from_shaft,
    uneven_factors,
)
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import tone_level
from twingap.effects.harmonic_series import HarmonicSeries
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register
from twingap.records import Condition, Record

Array = NDArray[np.float64]

_RECTIFIED: Final = 0.5
"""Part of the uneven hums that come from rectifiers and transformers: twice the mains frequency and its multiples."""

_OF_TWIN: Final = 0.1
"""Largest level of the twin's own line at the mains frequency, over the records', where the level is read off. A larger
value ignores stronger lines of the twin."""
_MOST_HARMONICS: Final = 20
"""Largest number of harmonics that have to decay geometrically."""
_GEOMETRIC: Final = 0.4
"""Largest deviation of the logarithm of an amplitude from a geometric decay. A larger value reads off less regular
hums, whose harmonics the effect does not describe."""
_FAINT: Final = 4.5
"""z of faint lines from which they are a hum: fewer than one in 100 machines without have some. A smaller value finds
fainter hums, and takes more lines for one."""
_BEYOND_DOUBT: Final = 6.5
"""The same where nothing else shows a gap. A smaller value finds fainter lines, and gives more false alarms."""


@register
@dataclass(frozen=True)
class MainsInterference(HarmonicSeries):
    """Hum of the mains and its harmonics: fixed in Hz whatever the speed, of zero width."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = ("EN 50160, Voltage characteristics of electricity (50 Hz)", RANDALL_BOOK)
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = ("drive_interference", "shaft_harmonics", "looseness")
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    features: ClassVar[tuple[str, ...]] = TONES
    turns: ClassVar[bool] = False
    most_harmonics: ClassVar[int] = 20
    regular: ClassVar[frozenset[str]] = frozenset(["decay", "n_harmonics"])

    level: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude of the fundamental"
    )
    decay: float = parameter(
        0.6, unit="", plausible=(0.2, 0.95), allowed=(0, 1), doc="amplitude of one harmonic over that of the one before"
    )
    mains_hz: float = parameter(
        50.0, unit="Hz", plausible=(50.0, 60.0), allowed=(50.0, 60.0), fitted=False, exact=True, searched=False,
        choices=(50.0, 60.0), least_spread=0.002, doc="frequency of the mains, 50 or 60 Hz",
    )  # fmt: skip
    n_harmonics: int = parameter(
        6, unit="", plausible=(3, 20), allowed=(1, 200), fitted=False, doc="number of harmonics"
    )

    @property
    def regular_levels(self) -> Array:
        """[n_harmonics] Amplitude of each, healthy rms."""
        return np.asarray(self.level * self.decay ** np.arange(self.n_harmonics))

    def base_hz(self, draft: Draft) -> float:
        return self.mains_hz

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        levels = self.levels
        add_harmonics(draft, self.mains_hz * draft.t, self.mains_hz, levels, rng.random(levels.size))

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {
            "level": tone_level(rng, machine, 2.0), "decay": rng.uniform(0.2, 0.9),
            "mains_hz": float(rng.choice([50.0, 60.0])), "n_harmonics": int(rng.integers(1, 9)),
        }  # fmt: skip

    @classmethod
    def certain(cls, seen: Observations) -> bool:
        """Where all records share faint lines of a hum, and the twin's do not."""
        return cls._lacks_faint_lines(seen, _FAINT)

    @classmethod
    def shows_gap(cls, seen: Observations) -> bool:
        return cls._lacks_faint_lines(seen, _BEYOND_DOUBT)

    @classmethod
    def _lacks_faint_lines(cls, seen: Observations, least: float) -> bool:
        """Whether the records have faint lines of at least this z, and the twin neither faint nor clear ones."""
        mains_hz = 60 if seen.features.get("pooled|faint_mains_hz") == 60.0 else 50
        return lacks_faint_lines(seen, "mains", least, clear=f"pooled|mains_{mains_hz}_max")

    @classmethod
    def read_off(cls, records: Iterable[Record], simulated: Iterable[Record]) -> Mapping[str, float]:
        """Frequency and amplitude, where all records have the same line at 50 or 60 Hz and the twin has none."""
        numbers = np.arange(1, _MOST_HARMONICS + 1)
        records = list(records)
        found = {base_hz: common_levels(records, np.asarray(base_hz * numbers, float)) for base_hz in (50.0, 60.0)}
        mains_hz = max(found, key=lambda base_hz: found[base_hz][0])
        levels = found[mains_hz]
        level = float(levels[0])
        if level <= 0 or common_levels(simulated, np.array([mains_hz]))[0] > _OF_TWIN * level:
            return {}
        numbers, levels = numbers[1:], levels[1:]
        there = levels > 0
        if there.any():
            fall, steps = np.log(levels[there] / level), numbers[there] - 1
            slope = float(fall @ steps / (steps @ steps))
            if slope >= 0 or np.abs(fall - slope * steps).max() > _GEOMETRIC:
                return {}
        # How many harmonics there are is searched: the weak ones do not stand out.
        return {"level": level, "mains_hz": mains_hz}

    @classmethod
    def not_read_off(cls, conditions: Sequence[Condition]) -> str:
        """Where too few records resolve 50 and 60 Hz from the multiples of shaft speed."""
        for mains_hz in (50.0, 60.0):
            kept = sum(resolved_from_shaft(mains_hz, c) for c in conditions)
            if kept < min(FEWEST, len(conditions)):
                return (
                    f"in {len(conditions) - kept} of {len(conditions)} records a multiple of shaft speed lies within "
                    f"{RESOLVED:g} resolution bins of {mains_hz:g} Hz, so that its level and that of the shaft's line "
                    f"cannot be told apart; record longer, or at a speed of which no multiple lies at {mains_hz:g} Hz"
                )
        return ""

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        factors, values = uneven_factors(rng), self.parameter_values()
        if rng.random() < _RECTIFIED:
            factors[0::2] *= 0.03
            factors[1] = max(factors[1], 1.0)
            values["n_harmonics"] = max(self.n_harmonics, 2)
        return UnevenMains(**values, factors=tuple(factors.tolist()))


@dataclass(frozen=True)
class UnevenMains(UnevenHarmonics, MainsInterference):
    """Hum whose harmonics are what the supply makes them."""
