"""How measured less simulated numbers change over speed and over the run, and whether that is chance.

numbers [records, signatures], speed or time --slope within each kind of record--> slope, normal deviate
RMS of all records, both parts ----excess over healthy ones----> levels of strikes and noise --slope--> `Levels.trends`
power around their harmonics -----the same-----------------------> levels of strikes, whatever else there is

A twin's impacts have one amplitude for each fault, so what a fault's level does over speed stays, however it was
calibrated. The held-out part alone may have met a fault at one speed only: levels are compared over both parts. The RMS
hears weak strikes, and every tone and knock beside them; what stands at harmonics of the impact rate is of strikes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.spectrum.record_summary import Outline
from twingap.records import Condition

Array = NDArray[np.float64]

FEWEST: Final = 4
"""Records below which nothing is said."""
_CLEAR: Final = 1.15
"""Power over that of healthy records from which strikes have a level of their own."""
_SURE: Final = 4.0
"""Standard deviations of the noise by which power at harmonics stands out where it has a level."""
_USUAL: Final = 0.05
"""What a level of a fault at a speed is usually off by, as a natural logarithm: harmonics meet modes here and there."""
_USUAL_NOISE: Final = 0.015
"""The same of noise, which has no harmonics."""
_KNOWN: Final = 4.0
"""How much that is known beforehand: as well as from so many degrees of freedom."""
_ALIKE: Final = 0.01
"""Speeds that differ by less, as logarithms, are one."""
_TRENDS: Final = (
    "speed_strikes", "speed_noise", "time_strikes", "time_noise", "speed_alone", "time_alone", "speed_answer",
    "time_answer",
)  # fmt: skip
NAMES: Final = tuple(f"{trend}{kind}" for trend in _TRENDS for kind in ("", "_z", "_size"))
"""Keys of `Levels.trends`: slope of a natural logarithm of amplitudes over that of the speed, or over the run; the
normal deviate that goes with it; and its size. `speed_alone`, `time_alone`: of strikes, the other course taken out;
`speed_answer`, `time_answer`: of the power at their harmonics."""


@dataclass(frozen=True)
class Levels:
    """Levels of records, measured and simulated under the same conditions.

    Parameters
    ----------
    conditions : tuple of Condition
    measured, simulated : Array [records]
        RMS about the mean, in one unit.
    answer : Array [records]
        ln of measured over simulated amplitude at the harmonics of the impact rate; NaN where either drowns in noise.
    """

    conditions: tuple[Condition, ...]
    measured: Array
    simulated: Array
    answer: Array

    @classmethod
    def of(cls, measured: Sequence[Outline], simulated: Sequence[Outline]) -> Levels:
        """Of what is kept of records, in the same order on both sides."""
        rms = [np.array([outline.rms for outline in side]) for side in (measured, simulated)]
        logs = [np.array([_at_harmonics(outline) for outline in side]) for side in (measured, simulated)]
        return cls(tuple(outline.condition for outline in measured), rms[0], rms[1], logs[0] - logs[1])

    def trends(self) -> dict[str, float]:
        """`NAMES` -> value, NaN where nothing is known."""
        kinds = np.array([c.fault or "" for c in self.conditions])
        ours, theirs = self._logs(self.measured), self._logs(self.simulated)
        strikes, noise = ours[0] - theirs[0], ours[1] - theirs[1]
        out: list[float] = []
        speed, time = courses(self.conditions)
        # How harmonics meet modes is one matter for all records of a fault at a speed: they are one observation.
        alike, each = np.rint(speed / _ALIKE).astype(int), np.arange(len(speed))
        both = np.isfinite(strikes + time)
        asked = [
            (x, cell, level, kinds, usual)
            for x, cell in ((speed, alike), (time, each))
            for level, usual in ((strikes, _USUAL), (noise, _USUAL_NOISE))
        ]
        for x, cell, other in ((speed, alike, time), (time, each, speed)):
            rest_x, rest = (_without(values[both], other[both], kinds[both]) for values in (x, strikes))
            asked.append((rest_x, cell[both], rest, kinds[both], _USUAL))
        asked += [(x, cell, self.answer, kinds, _USUAL) for x, cell in ((speed, alike), (time, each))]
        for x, cell, level, own, usual in asked:
            seen = np.isfinite(level + x)
            value, z = _trend(x[seen], cell[seen], level[seen], own[seen], usual)
            out += [value, z, abs(z)]
        return dict(zip(NAMES, out, strict=True))

    def _logs(self, rms: Array) -> tuple[Array, Array]:
        """[records] Log amplitude of what strikes add, and of records without any; NaN elsewhere."""
        healthy = np.array([c.fault == "healthy" for c in self.conditions])
        power = np.maximum(rms**2, 1e-300)
        quiet = float(power[healthy].mean()) if healthy.any() else 0.0
        heard = ~healthy & (power > _CLEAR * quiet)
        strikes = np.where(heard, 0.5 * np.log(np.maximum(power - quiet, 1e-300)), np.nan)
        return strikes, np.where(healthy, 0.5 * np.log(power), np.nan)


def _at_harmonics(outline: Outline) -> float:
    """ln of the amplitude of all that stands at the harmonics of the impact rate."""
    if outline.struck is None:
        return np.nan
    power, error = outline.struck.power, outline.struck.error
    total = float(power.sum())
    return 0.5 * float(np.log(total)) if total > _SURE * float(np.sqrt((error**2).sum())) else np.nan


def _without(y: Array, x: Array, kinds: NDArray[np.str_]) -> Array:
    """y less its slope over x, both about the means of their kinds."""
    x, y = x.copy(), y.copy()
    for kind in np.unique(kinds):
        own = kinds == kind
        x[own] -= x[own].mean()
        y[own] -= y[own].mean()
    return np.asarray(y - x * float(x @ y) / max(float(x @ x), 1e-12))


def courses(conditions: tuple[Condition, ...]) -> tuple[Array, Array]:
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
    """Least-squares slope over x within kinds of records.

    Parameters
    ----------
    x : Array [records]
    y : Array [records, signatures]
    kinds : Array [records]
        Each has a mean of its own.
    usual : float
        What y is usually off by; 0 where nobody knows. It counts as so many degrees of freedom more (Smyth 2004,
        doi:10.2202/1544-6115.1027), so few records that lie on a line by chance are not taken for exact.

    Returns
    -------
    Array [signatures], Array [signatures]
        Slope, and Student's t as a normal deviate; NaN where too few records tell.
    """
    nothing = np.full(y.shape[1], np.nan)
    known = np.isfinite(x)
    fewest = 2 if usual else FEWEST
    if known.sum() < fewest:
        return nothing, nothing
    x, y, kinds = x[known].copy(), y[known].copy(), kinds[known]
    for kind in np.unique(kinds):
        own = kinds == kind
        x[own] -= x[own].mean()
        y[own] -= np.nanmean(y[own], axis=0)
    if x.std() < 0.02:
        return nothing, nothing
    seen = np.isfinite(y)
    y = np.where(seen, y, 0.0)
    weight = seen * (x**2)[:, None]
    denominator = np.maximum(weight.sum(axis=0), 1e-12)
    found = (x[:, None] * y).sum(axis=0) / denominator
    rest = ((y - found * x[:, None]) * seen) ** 2
    count = seen.sum(axis=0)
    # A mean for each kind of record has been taken out, and the slope.
    free = count - sum(seen[kinds == kind].any(axis=0).astype(int) for kind in np.unique(kinds)) - 1
    more = _KNOWN if usual else 0.0
    variance = (rest.sum(axis=0) + more * usual**2) / np.maximum(free + more, 1)
    few = (count < fewest) | (free + more < 1)
    error = np.sqrt((variance + 1e-6) / denominator)
    return np.where(few, np.nan, found), np.where(few, np.nan, normal(found / error, free + more))


def normal(t: Array, free: NDArray[Any]) -> Array:
    """What a normal deviate would have to be to be as unlikely as Student's t with so many degrees of freedom.

    A handful of records shows large t by chance; as normal deviates they mean the same whatever their number. Wallace
    1959, doi:10.1214/aoms/1177706089, within 0.2 from three degrees of freedom on.
    """
    free = np.maximum(free, 1)
    size = (8 * free + 1) / (8 * free + 3) * np.sqrt(free * np.log1p(t * t / free))
    return np.asarray(np.sign(t) * size)
