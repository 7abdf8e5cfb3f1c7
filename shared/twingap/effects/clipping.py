"""Saturation of the converter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._references import IEEE_1057
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import faults
from twingap.effects.machine import Machine
from twingap.effects.registry import register
from twingap.records import Record

Array = NDArray[np.float64]

_VISITS: Final = 5
"""Smallest number of times that a record reaches its extreme if that is a rail. A larger value misses rails that are
seldom reached."""
_OVER: Final = 3
"""Samples on a rail over those on the level next to it. A larger value misses rails of coarse converters."""
_STRIP: Final = 0.02
"""Width of the strip inside a rail, as a part of a record's span."""
_EQUAL: Final = 4e-7
"""Largest relative difference of equal samples after conversions of unit in single precision."""
_SAME_RAIL: Final = 0.01
"""Largest relative difference of the rails of different records and sides. A larger value takes two rails for one."""


@register
@dataclass(frozen=True)
class Clipping(Effect):
    """Saturation: samples beyond the rails lie on them, and make atoms there in the amplitude distribution."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = (IEEE_1057,)
    group: ClassVar[str] = "acquisition"
    look_alikes: ClassVar[tuple[str, ...]] = ("impact_scatter", "quantisation")
    deciding_measurement: ClassVar[str] = measurements.CHAIN
    features: ClassVar[tuple[str, ...]] = (
        "converter.*", "background.quantile_*", "background.crest_log", "background.kurtosis_log",
    )  # fmt: skip

    rail: float = parameter(
        4.0, unit="healthy rms", plausible=(1.5, 15.0), allowed=(1e-9, 1e9), log=True, strength=False,
        doc="largest magnitude recorded",
    )  # fmt: skip

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        rail = self.rail * draft.reference_rms
        draft.x = np.clip(draft.x, -rail, rail)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        # Where the strongest records reach is known only roughly here; a rail that no sample reaches is no effect.
        reach = 3.2 if not faults(machine) else max(machine.parameters.impact_amplitude.values()) + 2.5
        return {"rail": max(reach * rng.uniform(0.25, 0.9), 1.6)}

    @classmethod
    def read_off(cls, records: Iterable[Record], simulated: Iterable[Record]) -> Mapping[str, float]:
        """The rail, where records that reach it agree on it and it is the same on both sides."""
        rails = np.array([rail for record in records for rail in _rails(np.asarray(record.samples, float))])
        if not rails.size or np.ptp(rails) > _SAME_RAIL * rails.max():
            return {}
        return {"rail": float(np.median(rails))}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return UnevenClipping(**self.parameter_values(), lower=rng.uniform(0.6, 1.5))


def _rails(x: Array) -> list[float]:
    """Magnitudes at which a record is cut off: none, one or two.

    A density that falls outwards fills a strip inside an extreme more than the extreme; so do the levels of a coarse
    converter.
    """
    found = []
    same, strip = _EQUAL * float(np.abs(x).max()), _STRIP * float(np.ptp(x))
    for side in (x, -x):
        top = float(side.max())
        at = side >= top - same
        visits = int(np.count_nonzero(at[1:] & ~at[:-1]))
        inside = side[~at & (side >= top - strip)]
        below = float(side[~at].max(initial=-np.inf))
        next_level = int(np.count_nonzero(~at & (side >= below - same)))
        count = int(np.count_nonzero(at))
        if visits >= _VISITS and count > inside.size and count > _OVER * next_level:
            found.append(abs(top))
    return found


@dataclass(frozen=True)
class UnevenClipping(Clipping):
    """Rails that do not lie alike about zero.

    Parameters
    ----------
    lower : float
        Lower rail over the upper.
    """

    lower: float = 1.0

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        rail = self.rail * draft.reference_rms
        draft.x = np.clip(draft.x, -self.lower * rail, rail)
