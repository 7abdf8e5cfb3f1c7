"""Missing stretches of a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class Dropout(Effect):
    """Missing stretches: a Poisson process of gaps of random (exponential) length, filled with the last good sample.

    A gap may reach beyond the record's end.
    """

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = ("Little & Rubin 2019, Statistical analysis with missing data",)
    group: ClassVar[str] = "acquisition"
    look_alikes: ClassVar[tuple[str, ...]] = ("impulsive_noise", "quantisation")
    deciding_measurement: ClassVar[str] = measurements.CHAIN
    features: ClassVar[tuple[str, ...]] = (
        "converter.*", "background.impulse_*", "background.rms_log", "background.segment_*", "background.white_level",
    )  # fmt: skip
    by_chance: ClassVar[bool] = True

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

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {"rate_hz": log_uniform(rng, 0.4, 20.0), "length_s": log_uniform(rng, 0.001, 0.03)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return ZeroFilledDropout(**self.parameter_values())


@dataclass(frozen=True)
class ZeroFilledDropout(Dropout):
    """Gaps that are filled with zeros."""

    def _filled(self, x: Array, missing: NDArray[np.bool_]) -> Array:
        return np.where(missing, 0.0, x)
