"""Growth of damage after the anomaly (eq. 12), and trajectories to failure that may follow.

A row k counts measurements; with times in s instead, rates are per s. Source: section 3.4 of paper 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from papers.arrays import Array
from papers.paper1_rul_varying_speed.methods.run import remaining_revolutions
from twingap import TwingapError
from twingap.prognosis.speed_influence import SpeedInfluence

LARGEST_EXPONENT = 50.0
"""exp(50) is beyond any sensor; it only keeps numbers finite, as in `effects.DamageGrowth`."""


@dataclass(frozen=True)
class DamageFit:
    """D(k) of eq. 12 for one run."""

    rate: float  # a, per row (or per unit of the k that was given). Not above 0: no growth was seen.
    rate_error: float  # its standard error from the scatter about the curve; NaN for a single row
    onset: float  # K_anomaly
    level: float  # Normalised amplitude at the onset: 1 by eq. 12.
    rows: int  # rows behind it

    def damage(self, k: ArrayLike) -> Array:
        """level D(k) at rows [...]."""
        return self.level * damage(k, self.rate, self.onset)


def damage(k: ArrayLike, rate: float, onset: float) -> Array:
    """D(k) = exp(a (k - K_anomaly)), eq. 12, at rows [...] (or times in s, with a rate per s); 1 before the onset."""
    grown = rate * np.maximum(np.asarray(k, float) - onset, 0.0)
    return np.asarray(np.exp(np.minimum(grown, LARGEST_EXPONENT)))


def fit_damage(
    k: ArrayLike, normalised: ArrayLike, onset: float, *, level: Literal["one", "free"] = "one"
) -> DamageFit:
    """Fit a of eq. 12 to normalised peak to peak [rows] after the onset, by least squares of its logarithm: scatter is
    in proportion to height. Rows (or times) `k` not after the onset and NaN amplitudes are left out; raises
    `TwingapError` when too few remain.

    `level` "one" is D(K_anomaly) = 1 as printed; "free" fits a factor too, for damage that begins with a jump or was
    found late, which "one" takes for speed of growth.
    """
    place, x = np.asarray(k, float) - onset, np.asarray(normalised, float)
    kept = (place > 0) & np.isfinite(x) & (np.where(np.isfinite(x), x, 0) > 0)
    place, height = place[kept], np.log(x[kept])
    unknowns = 1 if level == "one" else 2
    if np.unique(place).size < unknowns:
        raise TwingapError(
            f"{place.size} rows after the anomaly, {unknowns} or more needed", where="damage",
            mend="wait for more measurements",
        )  # fmt: skip
    centre, base = (0.0, 0.0) if level == "one" else (float(place.mean()), float(height.mean()))
    spread = float(np.sum((place - centre) ** 2))
    rate = float(np.sum((place - centre) * (height - base)) / spread)
    rest = height - base - rate * (place - centre)
    free = place.size - unknowns
    error = float(np.sqrt(np.sum(rest**2) / free / spread)) if free else float("nan")
    return DamageFit(rate, error, onset, float(np.exp(base - rate * centre)), int(place.size))


def end_row(peak_to_peak: ArrayLike, limit: float) -> int | None:
    """First row whose peak to peak (real or simulated, not normalised) reaches the limit: the end of life, or None."""
    beyond = np.flatnonzero(np.asarray(peak_to_peak, float) >= limit)
    return int(beyond[0]) if beyond.size else None


@dataclass(frozen=True)
class Trajectory:
    """One simulated life from the anomaly to its end."""

    rate: float  # a of eq. 12, per row.
    onset_row: int  # K_anomaly
    dt_s: float  # time from row to row
    speed_rpm: Array  # [rows] row 0 is K_anomaly, the last row the end of life
    speed_gain: Array  # [rows] S(k) of eq. 10, unit of the amplitude.
    growth: Array  # [rows] D(k) of eq. 12, with the fit's level.

    @property
    def end_row(self) -> int:
        """Row of the run at which life ends."""
        return self.onset_row + self.speed_rpm.size - 1

    @property
    def peak_to_peak(self) -> Array:
        """S(k) D(k) [rows]: the amplitude of eq. 1 that the twin is to give its impacts."""
        return self.speed_gain * self.growth

    @property
    def positions(self) -> Array:
        """Sequence positions [rows] for eq. 13: 1 at the first row after K_anomaly."""
        return np.arange(self.speed_rpm.size, dtype=np.float64)

    @property
    def remaining_revolutions(self) -> Array:
        """Labels [rows] by eq. 14, 0 at the end of life."""
        return remaining_revolutions(self.speed_rpm, self.dt_s)


def trajectories(
    fit: DamageFit, influence: SpeedInfluence, speed_rpm: ArrayLike, dt_s: float, limit: float, *, count: int = 6,
    simulation_range_s: float = 2400.0, not_before_row: int | None = None,
) -> list[Trajectory]:  # fmt: skip
    """Lives whose ends lie within the Simulation range about the end that the fitted rate (per row) foretells, shortest
    first, each of another rate.

    `speed_rpm` [rows] is the profile from K_anomaly on, seen, then planned, `limit` the peak to peak at which a life
    ends, `simulation_range_s` the greatest difference between two ends; none ends at `not_before_row` or before. Ends
    come only at fast rows, so they are about evenly spaced and two may share one. Raises `TwingapError` when no growth
    was seen, or no life ends within the profile or the range.
    """
    speed = np.asarray(speed_rpm, float)
    onset = round(fit.onset)
    if not fit.rate > 0:
        raise TwingapError(
            f"a rate of {fit.rate:.3g} per row is no growth", where="damage", mend="wait for more measurements"
        )
    gain = influence.amplitude(speed)
    # The rate at which each row just reaches the limit. A row can be an end only if no row before it needs less.
    running = gain > 0
    needed = np.full(speed.size, np.inf)
    needed[running] = np.log(limit / (fit.level * gain[running]))
    needed[1:] /= np.arange(1, speed.size)
    least = np.minimum.accumulate(needed[1:])
    if needed[0] <= 0 or (least.size and least.min() <= 0):
        raise TwingapError(
            f"a healthy bearing reaches {limit:g} at some speed of the profile", where="end of life",
            mend="raise the limit",
        )  # fmt: skip
    ends = 1 + np.flatnonzero(needed[1:] < np.concatenate(([np.inf], least[:-1])))
    rates = needed[ends]
    centre = np.flatnonzero(rates <= fit.rate)
    if centre.size == 0:
        raise TwingapError(
            f"no end of life within the {speed.size} rows of the speed profile", where="trajectories",
            mend="give a longer profile",
        )  # fmt: skip
    half = simulation_range_s / dt_s / 2
    middle = ends[centre[0]]
    first = max(middle - half, 1.0, 1.0 if not_before_row is None else not_before_row - onset + 1.0)
    window = np.flatnonzero((ends >= first) & (ends <= middle + half))
    if window.size == 0:
        raise TwingapError(
            f"the fitted rate ends life at row {onset + middle}, and the bearing lives on", where="trajectories",
            mend="fit the damage again with the rows measured since",
        )  # fmt: skip
    # Between two possible ends every rate leads to the later one: interpolating log a over rows, and stopping at the
    # last end of the window, keeps every life inside it.
    targets = _spread(float(first), float(ends[window[-1]]), count)
    before = ends[window[0] - 1] if window[0] else 0
    highest = rates[window[0] - 1] if window[0] else max(fit.rate, rates[0]) * 1.5
    rows = np.concatenate(([before], ends[window]))
    logs = np.log(np.concatenate(([highest], rates[window])))
    lives = []
    for target in targets:
        rate = float(np.exp(np.interp(target, rows, logs)))
        last = int(ends[np.flatnonzero(rates <= rate * (1 + 1e-12))[0]])
        growth = fit.level * damage(np.arange(last + 1), rate, 0.0)
        lives.append(Trajectory(rate, onset, dt_s, speed[: last + 1], gain[: last + 1], growth))
    return lives


def _spread(first: float, last: float, count: int) -> Sequence[float]:
    """Evenly spaced targets; a single one in the middle."""
    if count == 1:
        return [(first + last) / 2]
    # One possible end only: targets lie within the row before it, which all lead to it at rates of their own.
    return [float(v) for v in np.linspace(min(first, last - 0.5), last, count)]
