"""A coarse converter."""

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
from twingap.effects.drawing import log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register
from twingap.records import Record, RecordSet

_FEW: Final = 0.25
"""Distinct samples over all of a record up to which it is coarse. A larger value reads finer steps, less exactly."""
_MANY: Final = 0.6
"""The same of single units, whose step is not a name. A larger value finds steps that no measure shows."""
_WHOLE: Final = 0.02
"""Largest distance of a difference of neighbouring levels from a multiple of the step."""
_MOST: Final = 0.95
"""Part of these differences that have to be multiples. A smaller value reads a step off records with few levels."""
_SAME_STEP: Final = 0.01
"""Largest relative difference of the steps of records. A larger value takes two converters for one."""
_ROUNDING: Final = 1e-6
"""Relative difference up to which two samples are one level."""


@register
@dataclass(frozen=True)
class Quantisation(Effect):
    """A coarse converter: all samples are integer multiples of one step."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = (IEEE_1057, "Widrow & Kollar 2008, Quantization noise")
    group: ClassVar[str] = "acquisition"
    look_alikes: ClassVar[tuple[str, ...]] = ("clipping", "dropout")
    deciding_measurement: ClassVar[str] = measurements.CHAIN
    features: ClassVar[tuple[str, ...]] = ("converter.*", "background.white_level", "background.quantile_50")

    step: float = parameter(
        0.25, unit="healthy rms", plausible=(0.01, 2.0), allowed=(1e-9, 1e9), log=True, doc="step of the converter"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        step = self.step * draft.reference_rms
        draft.x = np.rint(draft.x / step) * step

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {"step": log_uniform(rng, 0.05, 2.0)}

    @classmethod
    def read_off(cls, records: Iterable[Record], simulated: Iterable[Record]) -> Mapping[str, float]:
        """The step, where all records have the same and the twin has none."""
        return cls._read(records, simulated, _FEW)

    @classmethod
    def read_off_unit(cls, records: RecordSet, simulated: Iterable[Record]) -> Mapping[str, float]:
        # Units recorded in different ranges have different steps, finer ones among them.
        return cls._read(records, simulated, _MANY)

    @staticmethod
    def _read(records: Iterable[Record], simulated: Iterable[Record], most: float) -> Mapping[str, float]:
        steps = np.array([_step(np.asarray(record.samples, float), most) for record in records])
        if not steps.size or not steps.min() > 0 or np.ptp(steps) > _SAME_STEP * steps.max():
            return {}
        if any(_step(np.asarray(record.samples, float), most) for record in simulated):
            return {}
        return {"step": float(np.median(steps))}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return MidRiseQuantisation(**self.parameter_values())


@dataclass(frozen=True)
class MidRiseQuantisation(Quantisation):
    """A converter without a zero of its own: samples lie halfway between multiples of its step."""

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        step = self.step * draft.reference_rms
        draft.x = (np.floor(draft.x / step) + 0.5) * step


def _step(x: NDArray[np.float64], most: float) -> float:
    """Step of which all samples are multiples, but for a common offset; 0 without one.

    `most` is the largest number of its levels, in parts of the samples.
    """
    levels = np.unique(x)
    gaps = np.diff(levels)
    gaps = gaps[gaps > _ROUNDING * np.abs(x).max()]
    if gaps.size < 2 or gaps.size + 1 > most * x.size:
        return 0.0
    for base in (gaps.min(), np.median(gaps)):  # the smallest may be that to a rail or to zero
        whole = np.rint(gaps / base)
        fits = (whole >= 1) & (np.abs(gaps / base - whole) < _WHOLE)
        if fits.mean() >= _MOST:
            return float(gaps[fits].sum() / whole[fits].sum())
    return 0.0
