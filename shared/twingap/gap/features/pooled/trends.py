"""Trends of levels over speed and over the run: slopes of measured less simulated values, and their significance.

values [records, features], speed or time --slope within each fault--> slope, normal deviate
RMS of all records, both parts ----excess over healthy ones----> levels of impacts and noise --slope--> `Levels.trends`
power at harmonics of the impact rate --ratio-----------------> levels of impacts, independent of tones and noise

A twin has one impact amplitude for each fault, so that calibration does not change the trend of a fault's level over
speed. Levels are compared over both parts, since one part may contain a fault at one speed only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.spectrum.record_summary import RecordSummary
from twingap.records import Array, Condition

FEWEST: Final = 4
"""Records below which no slope is computed."""
_CLEAR: Final = 1.15
"""Smallest power over that of healthy records at which the level of impacts is computed. A smaller value takes noise
for impacts."""
_SURE: Final = 4.0
"""Smallest power at harmonics, in standard errors. A smaller value admits noise."""
_USUAL: Final = 0.05
"""Prior scatter of a fault's log level between speeds, as harmonics pass modes. A larger value makes weak trends less
significant."""
_USUAL_NOISE: Final = 0.015
"""The same for noise."""
_KNOWN: Final = 4.0
"""Degrees of freedom of the prior scatter. A larger value gives the observed scatter less weight."""
_ALIKE: Final = 0.01
"""Log ratio below which speeds count as equal. A larger value averages more records."""
_TRENDS: Final = (
    "speed_impacts", "speed_noise", "time_impacts", "time_noise", "speed_partial", "time_partial", "speed_harmonics",
    "time_harmonics",
)  # fmt: skip
NAMES: Final = tuple(f"{trend}{kind}" for trend in _TRENDS for kind in ("", "_z", "_size"))
"""Keys of `Levels.trends`: slope of a natural logarithm of amplitudes over that of the speed, or over the run; the
normal deviate that goes with it; and its size. `speed_partial`, `time_partial`: of impacts, the other variable
regressed out; `speed_harmonics`, `time_harmonics`: of the power at the harmonics of the impact rate."""


@dataclass(frozen=True)
class Levels:
    """Levels of records, measured and simulated under the same conditions."""

    conditions: tuple[Condition, ...]
    measured: Array  # [records] RMS about the mean, in one unit
    simulated: Array
    # [records] ln of measured over simulated amplitude at harmonics of the impact rate; NaN below the noise.
    at_harmonics: Array

    @classmethod
    def of(cls, measured: Sequence[RecordSummary], simulated: Sequence[RecordSummary]) -> Levels:
        """From summaries of records, in the same order on both sides."""
        rms = [np.array([summary.rms for summary in side]) for side in (measured, simulated)]
        logs = [np.array([_at_harmonics(summary) for summary in side]) for side in (measured, simulated)]
        return cls(tuple(summary.condition for summary in measured), rms[0], rms[1], logs[0] - logs[1])

    def trends(self) -> dict[str, float]:
        """`NAMES` -> value, NaN where nothing is known."""
        kinds = np.array([c.fault or "" for c in self.conditions])
        ours, theirs = self._logs(self.measured), self._logs(self.simulated)
        impacts, noise = ours[0] - theirs[0], ours[1] - theirs[1]
        out: list[float] = []
        speed, time = covariates(self.conditions)
        # Records of a fault at one speed have the same harmonics at modes: they are one observation.
        alike, each = np.rint(speed / _ALIKE).astype(int), np.arange(len(speed))
        both = np.isfinite(impacts + time)
        wanted = [
            (x, cell, level, kinds, usual)
            for x, cell in ((speed, alike), (time, each))
            for level, usual in ((impacts, _USUAL), (noise, _USUAL_NOISE))
        ]
        for x, cell, other in ((speed, alike, time), (time, each, speed)):
            rest_x, rest = (_without(values[both], other[both], kinds[both]) for values in (x, impacts))
            wanted.append((rest_x, cell[both], rest, kinds[both], _USUAL))
        wanted += [(x, cell, self.at_harmonics, kinds, _USUAL) for x, cell in ((speed, alike), (time, each))]
        for x, cell, level, own, usual in wanted:
            known = np.isfinite(level + x)
            value, z = _trend(x[known], cell[known], level[known], own[known], usual)
            out += [value, z, abs(z)]
        return dict(zip(NAMES, out, strict=True))

    def _logs(self, rms: Array) -> tuple[Array, Array]:
        """[records] Log amplitude of the impacts, and of records without any; NaN elsewhere."""
        healthy = np.array([c.fault == "healthy" for c in self.conditions])
        power = np.maximum(rms**2, 1e-300)
        noise = float(power[healthy].mean()) if healthy.any() else 0.0
        detectable = ~healthy & (power > _CLEAR * noise)
        impacts = np.where(detectable, 0.5 * np.log(np.maximum(power - noise, 1e-300)), np.nan)
        return impacts, np.where(healthy, 0.5 * np.log(power), np.nan)


def _at_harmonics(summary: RecordSummary) -> float:
    """ln of the amplitude at all harmonics of the impact rate."""
    if summary.impact_spectrum is None:
        return np.nan
    power, error = summary.impact_spectrum.power, summary.impact_spectrum.error
    total = float(power.sum())
    return 0.5 * float(np.log(total)) if total > _SURE * float(np.sqrt((error**2).sum())) else np.nan


def _without(y: Array, x: Array, kinds: NDArray[np.str_]) -> Array:
    """Residual of y from its slope over x, both about the means of their kinds."""
    x, y = about_means(x, kinds), about_means(y, kinds)
    return np.asarray(y - x * float(x @ y) / max(float(x @ x), 1e-12))


def about_means(values: Array, kinds: NDArray[np.str_]) -> Array:
    """[records, ...] Values less the mean of the known ones of their kind of record."""
    out = values.copy()
    for kind in np.unique(kinds):
        out[kinds == kind] -= np.nanmean(values[kinds == kind], axis=0)
    return out


def covariates(conditions: tuple[Condition, ...]) -> tuple[Array, Array]:
    """[records] Log speed, and time as a part of the run; NaN without times."""
    speed = np.array([np.log(c.speed_rpm) for c in conditions])
    time = np.array([np.nan if c.time_s is None else c.time_s for c in conditions])
    span = np.nanmax(time) - np.nanmin(time) if np.isfinite(time).any() else 0.0
    return speed, time / span if span > 0 else np.full(len(speed), np.nan)


def _trend(
    x: Array, cells: NDArray[np.int64], level: Array, kinds: NDArray[np.str_], usual: float
) -> tuple[float, float]:
    """Slope of log amplitudes over x within kinds of records, and its deviate; records of one cell are averaged."""
    if len(x) < FEWEST:
        return math.nan, math.nan
    _, first, place = np.unique(
        np.char.add(kinds, [f"|{cell}" for cell in cells]), return_index=True, return_inverse=True
    )
    count = np.bincount(place)
    x, level = (np.bincount(place, values) / count for values in (x, level))
    (found,), (z,) = slope(x, level[:, None], kinds[first], usual)
    return float(found), float(z)


def slope(x: Array, y: Array, kinds: NDArray[np.str_], usual: float = 0.0) -> tuple[Array, Array]:
    """[features] Least-squares slope of y [records, features] over x [records] within kinds, and its t as a normal
    deviate.

    Each kind [records] of record, its fault, has its own mean. `usual` is a prior scatter of y with `_KNOWN` degrees of
    freedom (Smyth 2004, doi:10.2202/1544-6115.1027), so that few records on a line by chance do not give an exact
    slope; 0 for none. NaN with too few records.
    """
    nothing = np.full(y.shape[1], np.nan)
    known = np.isfinite(x)
    fewest = 2 if usual else FEWEST
    if known.sum() < fewest:
        return nothing, nothing
    kinds = kinds[known]
    x, y = about_means(x[known], kinds), about_means(y[known], kinds)
    if x.std() < 0.02:
        return nothing, nothing
    known = np.isfinite(y)
    y = np.where(known, y, 0.0)
    weight = known * (x**2)[:, None]
    denominator = np.maximum(weight.sum(axis=0), 1e-12)
    found = (x[:, None] * y).sum(axis=0) / denominator
    rest = ((y - found * x[:, None]) * known) ** 2
    count = known.sum(axis=0)
    # Less a mean for each kind of record, and the slope.
    free = count - sum(known[kinds == kind].any(axis=0).astype(int) for kind in np.unique(kinds)) - 1
    more = _KNOWN if usual else 0.0
    variance = (rest.sum(axis=0) + more * usual**2) / np.maximum(free + more, 1)
    few = (count < fewest) | (free + more < 1)
    error = np.sqrt((variance + 1e-6) / denominator)
    return np.where(few, np.nan, found), np.where(few, np.nan, normal_deviate(found / error, free + more))


def normal_deviate(t: Array, free: NDArray[Any]) -> Array:
    """Normal deviates with the tail probability of Student's t at these degrees of freedom.

    With few records, large t occur by chance; normal deviates are comparable between numbers of records. Wallace
    1959, doi:10.1214/aoms/1177706089, within 0.2 from three degrees of freedom on.
    """
    free = np.maximum(free, 1)
    size = (8 * free + 1) / (8 * free + 3) * np.sqrt(free * np.log1p(t * t / free))
    return np.asarray(np.sign(t) * size)
