"""Missing stretches of a record."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform
from twingap.effects.machine import Machine
from twingap.effects.registry import register
from twingap.records import Record

Array = NDArray[np.float64]

_FEWEST: Final = 6
"""Smallest number of gaps in all records from which rate and length are read. A larger number reads fewer, with smaller
errors."""
_BY_CHANCE: Final = 0.01
"""Number of runs of equal samples in a record that chance may make of the shortest that counts as a gap."""
_LONGEST_COUNTED: Final = 12
"""Repeats up to which runs made by chance are counted."""
_ZERO: Final = 0.05
"""Median level of gaps, over the standard deviation of the record, below which they are filled with zeros: those of a
record without its mean are near zero."""
_USUAL: Final = 0.005
"""Runs over samples from which they are made by chance. A smaller value takes frequent gaps for these."""


@register
@dataclass(frozen=True)
class Dropout(Effect):
    """Missing stretches: a Poisson process of gaps of random (exponential) length.

    They are filled with the last good sample, or with zeros. A gap may reach beyond the record's end.
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
    zeros: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), fitted=False, searched=False,
        doc="whether gaps are filled with zeros, not with the last good sample",
    )  # fmt: skip

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
        if self.zeros:
            return np.where(missing, 0.0, x)
        return np.asarray(x[np.maximum.accumulate(np.where(missing, 0, np.arange(x.size)))])

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {"rate_hz": log_uniform(rng, 0.4, 20.0), "length_s": log_uniform(rng, 0.001, 0.03)}

    @classmethod
    def read_off(cls, records: Iterable[Record], simulated: Iterable[Record]) -> Mapping[str, float]:
        """Rate, mean length and filling of runs of equal samples, where records have several and the twin has none.

        Runs shorter than chance makes them are not seen; lengths are exponential, so that their excess over any length
        has the same mean, and the number of all follows from that.
        """
        found, levels, seconds, shortest = [], [], 0.0, 0.0
        for record in records:
            x = np.asarray(record.samples, float)
            starts, runs, least = _gaps(x)
            levels.append(np.abs(x[starts]) / max(float(x.std()), 1e-300))
            found.append((runs - least + 1) / record.condition.fs_hz)
            shortest = max(shortest, (least - 1) / record.condition.fs_hz)
            seconds += record.condition.duration_s
        excess = np.concatenate(found) if found else np.zeros(0)
        if excess.size < _FEWEST or any(_gaps(np.asarray(r.samples, float))[1].size for r in simulated):
            return {}
        length_s = float(excess.mean())
        rate_hz = excess.size / seconds * math.exp(min(shortest / length_s, 1.0))
        zeros = bool(np.median(np.concatenate(levels)) < _ZERO)
        return {"rate_hz": rate_hz, "length_s": length_s, "zeros": zeros}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return ZeroFilledDropout(**self.parameter_values())


@dataclass(frozen=True)
class ZeroFilledDropout(Dropout):
    """Gaps that are filled with zeros, as the other form that is learnt from."""

    def _filled(self, x: Array, missing: NDArray[np.bool_]) -> Array:
        return np.where(missing, 0.0, x)


def _gaps(x: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """First sample of each run of equal samples that is no chance, number of its repeats, and the least such number.

    Runs at the extremes are those of a rail.
    """
    same = x[1:] == x[:-1]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
    starts, lengths = edges[::2], edges[1::2] - edges[::2]
    off_rails = (x[starts] != x.max()) & (x[starts] != x.min())
    # Samples of a coarse converter repeat by chance; the longer a run, the more often it goes on.
    longer = [int(np.count_nonzero(lengths >= k)) for k in range(1, _LONGEST_COUNTED + 1)]
    usual = [after / before for before, after in pairwise(longer) if before > _USUAL * x.size]
    goes_on = min(max(usual, default=0.0), 0.99)
    least = 2 + math.ceil(math.log(_BY_CHANCE / x.size) / math.log(max(goes_on, 1e-6)))
    gaps = off_rails & (lengths >= least)
    return starts[gaps], lengths[gaps], least
