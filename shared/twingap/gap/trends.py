"""How measured less simulated numbers change over speed and over the run, and whether that is chance.

numbers [records, signatures], speed or time --slope within each kind of record--> slope, normal deviate
RMS of all records, both parts ----excess over healthy ones----> levels of strikes and noise --slope--> `Levels.trends`
power around their harmonics -----the same-----------------------> levels of strikes, whatever else there is

A twin's impacts have one amplitude for each fault, so what a fault's level does over speed stays, however it was
calibrated. The held-out part alone may have met a fault at one speed only: levels are compared over both parts. The RMS
hears weak strikes, and every tone and knock beside them; what stands at harmonics of the impact rate is of strikes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.signatures.outline import Outline
from twingap.records import Condition

Array = NDArray[np.float64]

FEWEST: Final = 4
"""Records below which nothing is said."""
_CLEAR: Final = 1.15
"""Power over that of healthy records from which strikes have a level of their own."""
_SURE: Final = 4.0
"""Standard deviations of the noise by which power at harmonics stands out where it has a level."""
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
        both = np.isfinite(strikes + time)
        asked = [(x, level, kinds) for x in (speed, time) for level in (strikes, noise)]
        for x, other in ((speed, time), (time, speed)):
            rest_x, rest = (_without(values[both], other[both], kinds[both]) for values in (x, strikes))
            asked.append((rest_x, rest, kinds[both]))
        asked += [(x, self.answer, kinds) for x in (speed, time)]
        for x, level, own in asked:
            seen = np.isfinite(level)
            (value,), (z,) = slope(x[seen], level[seen, None], own[seen])
            out += [float(value), float(z), abs(float(z))]
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


def slope(x: Array, y: Array, kinds: NDArray[np.str_]) -> tuple[Array, Array]:
    """Least-squares slope over x within kinds of records.

    Parameters
    ----------
    x : Array [records]
    y : Array [records, signatures]
    kinds : Array [records]
        Each has a mean of its own.

    Returns
    -------
    Array [signatures], Array [signatures]
        Slope, and Student's t as a normal deviate; NaN where too few records tell.
    """
    nothing = np.full(y.shape[1], np.nan)
    known = np.isfinite(x)
    if known.sum() < FEWEST:
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
    error = np.sqrt((rest.sum(axis=0) / np.maximum(free, 1) + 1e-6) / denominator)
    few = (count < FEWEST) | (free < 1)
    return np.where(few, np.nan, found), np.where(few, np.nan, normal(found / error, free))


def normal(t: Array, free: NDArray[np.int64]) -> Array:
    """What a normal deviate would have to be to be as unlikely as Student's t with so many degrees of freedom.

    A handful of records shows large t by chance; as normal deviates they mean the same whatever their number. Wallace
    1959, doi:10.1214/aoms/1177706089, within 0.2 from three degrees of freedom on.
    """
    free = np.maximum(free, 1)
    size = (8 * free + 1) / (8 * free + 3) * np.sqrt(free * np.log1p(t * t / free))
    return np.asarray(np.sign(t) * size)
