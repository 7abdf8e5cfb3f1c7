"""Forecast of a fitted curve: band, remaining life with an interval, and error on later records.

CurveFit --refits to bootstrap series--> band, time at which a level is reached: life, interval
run, fraction of life --fit on the first part--> error on the rest

Bootstrap series have noise like the residuals: an AR(1) process of their correlation with their local spread (a sieve
bootstrap, Buehlmann 1997, DOI 10.2307/3318584, with heteroscedasticity as in the wild bootstrap). Intervals cover the
uncertainty of parameters for a correct model, not that of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular
from scipy.signal import lfilter

from twingap.errors import TwingapError
from twingap.prognosis.degradation_models import AMPLITUDE_LIMIT, CurveFit, CurveModel, checked, fit_curve
from twingap.prognosis.information import LONGEST_MEMORY, memory_of

Array = NDArray[np.float64]

TENTHS: Final = tuple(k / 10 for k in range(1, 10))
MOST_ROWS: Final = 400
"""Number of rows to which longer runs are averaged before refits; more are slower."""
_REFINED: Final = (0.7, 0.84, 0.93, 1.08, 1.19, 1.4)
"""Factors on exponents tried around the best grid point."""
_STEPS: Final = 5
"""Gauss-Newton steps after the grid; more are slower and hardly more precise."""


@dataclass(frozen=True)
class Curves:
    """Refits of one model to bootstrap series.

    Parameters
    ----------
    fit : CurveFit
        Fit to the measured series.
    coefficients : Array [curves, linear]
    exponents : Array [curves, exponents]
    scatter : Array [rows]
        Standard deviation of single records about the curve, near each row of the fit.
    """

    fit: CurveFit
    coefficients: Array
    exponents: Array
    scatter: Array

    def at(self, time_s: ArrayLike) -> Array:
        """Values of the curves [curves, times]."""
        u = self.fit.scaled(np.asarray(time_s, float))
        return np.stack([
            self.fit.model.curve(u, c, tuple(map(float, e)))
            for c, e in zip(self.coefficients, self.exponents, strict=True)
        ])  # fmt: skip

    def band(
        self, time_s: ArrayLike, level: float = 0.9, rng: np.random.Generator | None = None
    ) -> tuple[Array, Array]:
        """Interval of the curve at each time [times]; of single records when a generator is given.

        The scatter of later records is assumed to be that of the last rows.
        """
        values = self.at(time_s)
        if rng is not None:
            near = np.interp(np.asarray(time_s, float), self.fit.time_s, self.scatter)
            values = values + near * rng.standard_normal(values.shape)
        low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2], axis=0, method="inverted_cdf")
        return low, high


@dataclass(frozen=True)
class RemainingLife:
    """Time until a curve reaches a level.

    Parameters
    ----------
    life_s : float
        Time from the last record, s; 0 when the level has been passed, inf when it is not reached within the horizon.
    low_s, high_s : float
        Interval, s; inf when not reached within the horizon.
    never : float
        Fraction of curves that do not reach it.
    """

    life_s: float
    low_s: float
    high_s: float
    never: float


@dataclass(frozen=True)
class OutOfSample:
    """Error of a curve on records it was not fitted to.

    Parameters
    ----------
    share : float
        Fraction of the life that was fitted.
    rmse_rest : float
        Error on all later records, in the unit of the indicator.
    rmse_next : float
        Error on those of the next tenth only.
    rows : int
        Number of records that were fitted.
    """

    share: float
    rmse_rest: float
    rmse_next: float
    rows: int


def redrawn(fit: CurveFit, n_curves: int, rng: np.random.Generator) -> Curves:
    """Refits of a model to bootstrap series around its fitted curve.

    Parameters
    ----------
    fit : CurveFit
        Its residuals are clipped at four robust standard deviations, so that a spike does not enlarge the noise.
    n_curves : int
    rng : Generator

    Returns
    -------
    Curves
        Bounded least squares, by a grid of exponents and Gauss-Newton steps.
    """
    u, centre, off = _thinned(fit)
    n, model = u.size, fit.model
    middle = float(np.median(off))
    widest = 4 * 1.4826 * float(np.median(np.abs(off - middle)))
    if widest > 0:
        off = np.clip(off, middle - widest, middle + widest)
    # Residuals are too small where leverage is high (at the ends), more so for correlated noise; this is corrected.
    rho = memory_of(off)
    held = leverage(fit, u) * (1 + max(rho, 0.0)) / (1 - max(rho, 0.0))
    off = off / np.sqrt(1 - np.minimum(held, 0.75))
    spread = _local_spread(off)
    # The correlation of residuals is biased for the same reason: by (1 + 3 rho) / n for a fitted mean (Kendall 1954),
    # and by about as much for every further parameter.
    rho = min(rho + (1 + 3 * rho) * model.parameters / n, LONGEST_MEMORY) if rho > 0 else rho
    shocks = rng.standard_normal((n_curves, n))
    shocks[:, 1:] *= np.sqrt(1 - rho**2)
    noise = np.asarray(lfilter([1.0], [1.0, -rho], shocks, axis=1), float) * spread
    # The spread is estimated from a limited number of independent rows, which is accounted for as in Student's t.
    free = max(n * (1 - rho**2) / (1 + rho**2) - model.parameters, 4.0)
    noise *= np.sqrt(free / rng.chisquare(free, n_curves))[:, None]
    size = float(np.abs(fit.values).max()) or 1.0
    coefficients, exponents = refitted(model, u, ((centre + noise) / size).T, fit.exponents)
    return Curves(fit, coefficients * size, exponents, _local_spread(fit.residuals))


def leverage(fit: CurveFit, u: Array) -> Array:
    """Leverage of each row [rows]: diagonal of the hat matrix of the linearised model."""
    sloped = [(fit.coefficients[column] * each)[:, None] for column, each in fit.model.slopes(u, fit.exponents)]
    jacobian = np.concatenate([fit.model.design(u, fit.exponents), *sloped], axis=1)
    size = np.sqrt(np.sum(jacobian**2, axis=0))
    q, r = np.linalg.qr(jacobian[:, size > 0] / size[size > 0])
    kept = np.abs(np.diag(r)) > 1e-8
    return np.asarray(np.sum(q[:, kept] ** 2, axis=1), float)


def refitted(model: CurveModel, u: Array, y: Array, near: tuple[float, ...]) -> tuple[Array, Array]:
    """Least-squares fits of many series at once.

    Parameters
    ----------
    model : CurveModel
    u : Array [rows]
    y : Array [rows, series]
        Series relative to the largest indicator.
    near : tuple of float
        Exponents to try first.

    Returns
    -------
    coefficients : Array [series, linear]
    exponents : Array [series, exponents]
    """
    count = y.shape[1]
    power = np.sum(y**2, axis=0)
    least = np.full(count, np.inf)
    coefficients, chosen = np.zeros((count, model.linear)), np.tile(np.array(near, float), (count, 1))

    def attempt(exponents: tuple[float, ...], which: NDArray[np.intp]) -> None:
        q, r = np.linalg.qr(model.design(u, exponents))
        diagonal = np.abs(np.diag(r))
        if diagonal.min() <= 1e-9 * diagonal.max():
            return
        turned = q.T @ y[:, which]
        rss = power[which] - np.sum(turned**2, axis=0)
        found = solve_triangular(r, turned)
        better = (rss < least[which]) & (np.abs(found).max(axis=0) <= AMPLITUDE_LIMIT)
        at = which[better]
        least[at], coefficients[at], chosen[at] = rss[better], found[:, better].T, exponents

    everything = np.arange(count)
    attempt(near, everything)
    for exponents in model.grid():
        attempt(exponents, everything)
    if model.starts:
        low, high = model.bounds
        best = chosen.copy()
        for centre in np.unique(best, axis=0):
            which = np.flatnonzero((best == centre).all(axis=1))
            for exponents in _about(centre, _REFINED):
                inside = all(low <= e <= high for e in exponents)
                apart = len(exponents) < 2 or exponents[1] >= model.spread * exponents[0]
                if inside and apart:
                    attempt(exponents, which)
    # A series that no grid point fits within the bounds keeps the exponents of `near`.
    lost = ~np.isfinite(least)
    if lost.any():
        coefficients[lost] = np.linalg.lstsq(model.design(u, near), y[:, lost], rcond=1e-10)[0].T
    if model.starts:
        for _ in range(_STEPS):
            _step(model, u, y, coefficients, chosen)
    return coefficients, chosen


def _step(model: CurveModel, u: Array, y: Array, coefficients: Array, exponents: Array) -> None:
    """One Gauss-Newton step of every series, in place; a quarter of it, or none, where that reduces the error."""
    low, high = model.bounds
    count, linear = coefficients.shape
    shape = (count, u.size)

    def columns(e: Array) -> list[Array]:
        found = model.columns(u[None], tuple(e[:, k, None] for k in range(e.shape[1])))
        return [np.broadcast_to(column, shape) for column in found]

    def residuals(c: Array, e: Array) -> Array:
        return y.T - sum(c[:, k, None] * column for k, column in enumerate(columns(e)))

    off = residuals(coefficients, exponents)
    slopes = model.slopes(u[None], tuple(exponents[:, k, None] for k in range(exponents.shape[1])))
    sloped = [np.broadcast_to(coefficients[:, column, None] * each, shape) for column, each in slopes]
    jacobian = np.stack([*columns(exponents), *sloped], axis=-1)
    size = np.sqrt(np.sum(jacobian**2, axis=1))
    size[size == 0] = 1.0
    jacobian = jacobian / size[:, None]
    # Slight damping, since columns of similar exponents are nearly collinear.
    normal = jacobian.transpose(0, 2, 1) @ jacobian + 1e-10 * np.eye(jacobian.shape[-1])
    move = np.linalg.solve(normal, jacobian.transpose(0, 2, 1) @ off[..., None])[..., 0] / size
    rss = np.sum(off**2, axis=1)
    for part in (1.0, 0.25):
        c, e = coefficients + part * move[:, :linear], exponents + part * move[:, linear:]
        allowed = (np.abs(c).max(axis=1) <= AMPLITUDE_LIMIT) & (e >= low).all(axis=1) & (e <= high).all(axis=1)
        c, e = np.where(allowed[:, None], c, coefficients), np.where(allowed[:, None], e, exponents)
        new = np.sum(residuals(c, e) ** 2, axis=1)
        better = new < rss
        coefficients[better], exponents[better], rss[better] = c[better], e[better], new[better]
        move[better] = 0.0


def remaining_life(
    curves: Curves, limit: float, *, rising: bool = True, level: float = 0.9, horizon: float = 20.0
) -> RemainingLife:
    """Time until the limit is reached, counted from the last record of the fit.

    Parameters
    ----------
    curves : Curves
    limit : float
        Indicator at which life ends.
    rising : bool
        Whether the limit is reached from below.
    level : float
        Coverage of the interval.
    horizon : float
        Longest forecast, relative to the duration of the run.

    Returns
    -------
    RemainingLife
    """
    fit = curves.fit
    own = _reached(fit, fit.coefficients[None], np.array([fit.exponents], float), limit, rising, horizon)[0]
    lives = np.sort(_reached(fit, curves.coefficients, curves.exponents, limit, rising, horizon))
    # Order statistics, since interpolation between a time and infinity is undefined.
    places = [round((lives.size - 1) * q) for q in ((1 - level) / 2, (1 + level) / 2)]
    return RemainingLife(own, float(lives[places[0]]), float(lives[places[1]]), float(np.mean(np.isinf(lives))))


def out_of_sample(
    model: CurveModel,
    time_s: ArrayLike,
    values: ArrayLike,
    *,
    shares: Sequence[float] = TENTHS,
    robust: bool = False,
) -> list[OutOfSample]:
    """Errors on later records of fits to the first part of a run.

    Parameters
    ----------
    model : CurveModel
    time_s, values : array_like [rows]
    shares : sequence of float
        Fractions of the time from first to last record, between 0 and 1; those with too few records are left out.
    robust : bool
        See `fit_curve`.

    Returns
    -------
    list[OutOfSample]
        A fit to a fraction does not depend on later records.
    """
    t, y = checked(time_s, values, at_least=3)
    found = []
    for share in shares:
        if not 0 < share < 1:
            raise TwingapError(f"share {share!r}, between 0 and 1 expected", where="out of sample")
        rows = rows_until(t, share)
        if rows < model.parameters + 2 or rows >= t.size:
            continue
        fit = fit_curve(model, t[:rows], y[:rows], robust=robust)
        off = fit.at(t[rows:]) - y[rows:]
        near = t[rows:] <= t[0] + (share + 0.1) * (t[-1] - t[0])
        near[0] = True
        found.append(OutOfSample(share, _rms(off), _rms(off[near]), rows))
    return found


def rows_until(time_s: NDArray[Any], share: float) -> int:
    """Number of records up to a fraction of the time from first to last."""
    return int(np.searchsorted(time_s, time_s[0] + share * (time_s[-1] - time_s[0]) * (1 + 1e-12), side="right"))


def _about(centre: Array, factors: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Exponents around a centre, varied one at a time and together."""
    found = []
    for factor in factors:
        for k in range(centre.size):
            moved = centre.copy()
            moved[k] *= factor
            found.append(tuple(map(float, moved)))
        if centre.size > 1:
            found.append(tuple(map(float, centre * factor)))
    return found


def _local_spread(off: Array) -> Array:
    """Root mean square over a window of a fifth of the rows around each row [rows]."""
    length = min(max(30, off.size // 5), off.size)
    return np.sqrt(_moving_sum(off**2, length) / _moving_sum(np.ones(off.size), length))


def _moving_sum(x: Array, length: int) -> Array:
    """Moving sum over a window of `length` rows, centred as by `np.convolve` [rows].

    A window consists of the end of one block and the beginning of the next, so it needs two cumulative sums for any
    length, without the cancellation of differences of a running sum.
    """
    padded_size = -(-(x.size + length) // length) * length
    padded = np.zeros(padded_size)
    padded[length // 2 : length // 2 + x.size] = x
    blocks = padded.reshape(-1, length)
    until = np.cumsum(blocks, axis=1).ravel()
    since = np.cumsum(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    first = np.arange(x.size)
    return np.where(first % length == 0, 0.0, since[first]) + until[first + length - 1]


def _thinned(fit: CurveFit) -> tuple[Array, Array, Array]:
    """Scaled time, curve and residuals, averaged to at most `MOST_ROWS` rows."""
    u, residuals = fit.scaled(fit.time_s), fit.residuals
    step = -(-u.size // MOST_ROWS)
    if step > 1:
        # Groups are complete from the end, since the latest rows matter most for the forecast.
        cut = u.size % step
        u, residuals = (x[cut:].reshape(-1, step).mean(axis=1) for x in (u, residuals))
    return u, fit.model.curve(u, fit.coefficients, fit.exponents), residuals


def _reached(fit: CurveFit, coefficients: Array, exponents: Array, limit: float, rising: bool, horizon: float) -> Array:
    """Time after the last row at which each curve first reaches the limit, s; inf when it does not."""
    ahead = np.concatenate([[0.0], np.geomspace(1e-4, horizon, 400)])
    sign = 1.0 if rising else -1.0
    lives = np.empty(len(coefficients))
    for place, (c, e) in enumerate(zip(coefficients, exponents, strict=True)):
        over = sign * (fit.model.curve(1 + ahead, c, tuple(map(float, e))) - limit)
        at = int(np.argmax(over >= 0))
        if over[at] < 0:
            lives[place] = np.inf
        elif at == 0:
            lives[place] = 0.0
        else:
            part = -over[at - 1] / (over[at] - over[at - 1])
            lives[place] = fit.span_s * (ahead[at - 1] + part * (ahead[at] - ahead[at - 1]))
    return lives


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))
