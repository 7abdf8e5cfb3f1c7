"""Effects of the acquisition: what the converter and the recording do to the samples. They act alike on every twin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.registry import register

Array = NDArray[np.float64]

_IEEE = "IEEE Std 1057, Digitizing waveform recorders"


@register
@dataclass(frozen=True)
class Clipping(Effect):
    """Saturation: samples beyond the rails lie on them, and make atoms there in the amplitude distribution."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = (_IEEE,)
    rail: float = parameter(
        4.0, unit="healthy rms", plausible=(1.5, 15.0), allowed=(1e-9, 1e9), log=True, doc="largest magnitude recorded"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        rail = self.rail * draft.reference_rms
        draft.x = np.clip(draft.x, -rail, rail)


@register
@dataclass(frozen=True)
class Quantisation(Effect):
    """A coarse converter: all samples are whole multiples of one step."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = (_IEEE, "Widrow & Kollar 2008, Quantization noise")
    step: float = parameter(
        0.25, unit="healthy rms", plausible=(0.01, 2.0), allowed=(1e-9, 1e9), log=True, doc="step of the converter"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        step = self.step * draft.reference_rms
        draft.x = np.rint(draft.x / step) * step


@register
@dataclass(frozen=True)
class Dropout(Effect):
    """Missing stretches: a Poisson process of gaps of random (exponential) length, filled with the last good sample.

    A gap may reach beyond the record's end.
    """

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = ("Little & Rubin 2019, Statistical analysis with missing data",)
    rate_hz: float = parameter(
        3.0, unit="1/s", plausible=(0.2, 20.0), allowed=(0, 1e4), log=True, doc="mean number of gaps per second"
    )
    length_s: float = parameter(
        0.005, unit="s", plausible=(0.0005, 0.05), allowed=(0, 1e3), log=True, doc="mean length of a gap"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        n, fs_hz = draft.x.size, draft.condition.fs_hz
        count = rng.poisson(self.rate_hz * n / fs_hz)
        starts = rng.integers(0, n, count)
        lengths = np.ceil(rng.exponential(self.length_s, count) * fs_hz).astype(np.int64)
        if count == 0:
            return
        # +1 after the last good sample, -1 where the gap ends: the running sum is positive inside gaps.
        edges = np.zeros(n + 1, dtype=np.int64)
        np.add.at(edges, starts + 1, 1)
        np.add.at(edges, np.minimum(starts + 1 + lengths, n), -1)
        missing = np.cumsum(edges)[:n] > 0
        draft.x = self._filled(draft.x, missing)

    def _filled(self, x: Array, missing: NDArray[np.bool_]) -> Array:
        return np.asarray(x[np.maximum.accumulate(np.where(missing, 0, np.arange(x.size)))])
