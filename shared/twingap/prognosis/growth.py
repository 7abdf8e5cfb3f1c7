"""Posterior over growth laws of amplitude, and over remaining revolutions, from the growth observed so far.

log amplitude over revolutions, healthy = 0 --> weights of laws (rate r, curvature q) --+
level at which life ends ---------------------------------------------------------------+--> weighted lives

In the family d(log D)/du = r exp(q (log D - l)), r is the relative growth per revolution at the present level l. It
contains the usual laws: q = 0 the exponential of eq. 12 of paper 1, q = -1 linear growth, -1 < q < 0 powers of time,
q > 0 accelerating growth as of Paris' law (dD/du = a D^(q + 1)). Relative to the present row, past and future have
closed forms, so only the shape has to be searched and not the unknown onset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CURVATURES = np.array([-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.5])
_CURVATURE_PRIOR = np.log([0.10, 0.15, 0.25, 0.20, 0.15, 0.10, 0.05])
_COARSE = np.geomspace(0.01, 100.0, 33)
"""Grid of rates, relative to revolutions since the onset: a scale-free prior, flat in log r."""
_NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
_NODE_LOGS = np.log([1 / 6, 2 / 3, 1 / 6])
_FREEDOM = 4.0
"""Degrees of freedom of Student's t for the scatter; fewer give outliers less weight."""
_LOWEST = -12.0
"""Log amplitude of a law before its beginning."""
_NEAR, _FAR = 0.1, 0.6
"""Deviation of a run from a single law, in log amplitude: at the present row, and at the onset. Larger values widen
intervals; these give narrow ones after calibration on simulated runs."""
_EARLY = 0.7
"""Fraction of the largest of n normal deviates, sqrt(2 log n), that is reached while amplitude is growing; larger makes
lives end earlier."""


@dataclass(frozen=True)
class Observations:
    """Amplitudes of a run up to a row, in bins.

    Parameters
    ----------
    ago : Array [bins]
        Revolutions before the present row, at least 0.
    log_amplitude : Array [bins]
        Natural logarithm of normalised amplitude.
    variance : Array [bins]
        Variance of the log amplitude due to scatter.
    after_onset : NDArray[bool] [bins]
        Whether the bin is after the onset.
    since_onset : float
        Revolutions from the onset to the present row, above 0.
    scatter : float
        Standard deviation of one row's log amplitude.
    per_row : float
        Mean revolutions between rows.
    """

    ago: Array
    log_amplitude: Array
    variance: Array
    after_onset: NDArray[np.bool_]
    since_onset: float
    scatter: float
    per_row: float


@dataclass(frozen=True)
class Lives:
    """Distribution of remaining revolutions as weighted values.

    Parameters
    ----------
    revolutions : Array [n]
        Values, increasing.
    cumulated : Array [n]
        Cumulative weight up to the middle of each, 0 to 1.
    level : float
        Mean present log amplitude.
    """

    revolutions: Array
    cumulated: Array
    level: float

    def quantile(self, share: float) -> float:
        """Quantile of remaining revolutions for a fraction of the weight."""
        return float(np.interp(share, self.cumulated, self.revolutions))


def shape(ago: Array, rate: Array, curvature: Array) -> Array:
    """Log amplitude of a law `ago` revolutions before the present row, relative to it; at most 0.

    Parameters
    ----------
    ago : Array [bins]
    rate : Array [...]
        Rate r, per revolution.
    curvature : Array [...]
        Curvature q.

    Returns
    -------
    Array [..., bins]
        `_LOWEST` before the beginning of the law.
    """
    back = rate[..., None] * ago
    q = curvature[..., None]
    inner = 1 + q * back
    bent = -np.log(np.maximum(inner, 1e-12)) / np.where(q == 0, 1.0, q)
    return np.maximum(np.where(q == 0, -back, np.where(inner > 0, bent, _LOWEST)), _LOWEST)


def remaining(distance: Array, rate: Array, curvature: Array) -> Array:
    """Revolutions in which a law grows by `distance` (log amplitude), 0 if negative. Arguments broadcast."""
    d = np.maximum(distance, 0.0)
    bent = -np.expm1(-curvature * d) / np.where(curvature == 0, 1.0, curvature)
    return np.asarray(np.where(curvature == 0, d, bent) / rate)


def lives(observed: Observations, end: float) -> Lives:
    """Posterior of remaining revolutions.

    Parameters
    ----------
    observed : Observations
    end : float
        Log amplitude at which life ends.

    Returns
    -------
    Lives
        Sum over a grid of rates (refined once), curvatures, and the present level (3-point Gauss-Hermite about its
        weighted mean under each law). Scatter has Student's t distribution with 4 degrees of freedom. Since life ends
        at the first row beyond the end level, scatter makes it end early: the level is lowered by the largest deviation
        to be expected among the rows near it.
    """
    rates = _COARSE / observed.since_onset
    weight = _evidence(observed, rates)[0]
    mass = np.exp(weight - weight.max()).sum(axis=1)
    reached = np.flatnonzero(mass > 1e-4 * mass.max())
    rates = np.geomspace(rates[max(reached[0] - 1, 0)], rates[min(reached[-1] + 1, rates.size - 1)], 33)
    weight, level, error = _evidence(observed, rates)
    now = level[..., None] + error[..., None] * _NODES
    logs = (weight + _CURVATURE_PRIOR)[..., None] + _NODE_LOGS
    r, q = rates[:, None, None], CURVATURES[:, None]
    growth = r * np.exp(np.clip(q * (end - now), -20, 20)) * observed.per_row
    early = observed.scatter * _EARLY * np.sqrt(2 * np.log1p(observed.scatter / np.maximum(growth, 1e-12)))
    left = remaining(end - early - now, r, q)
    w = np.exp(logs - logs.max()).ravel()
    w /= w.sum()
    order = np.argsort(left.ravel(), kind="stable")
    cumulated = np.cumsum(w[order]) - w[order] / 2
    mean = float(np.sum(now.ravel() * w))
    return Lives(left.ravel()[order], cumulated, mean)


def _evidence(observed: Observations, rates: Array) -> tuple[Array, Array, Array]:
    """Log likelihood [rates, curvatures], the present level under each law and its standard error."""
    r, q = np.broadcast_arrays(rates[:, None], CURVATURES[None, :])
    past = shape(observed.ago, r, q)
    variance = observed.variance + _NEAR**2 + (_FAR * observed.ago / observed.since_onset) ** 2
    precise = np.where(observed.after_onset & (past > -3.0), 1 / variance, 0.0)
    total = precise.sum(axis=-1)
    level = np.sum(precise * (observed.log_amplitude - past), axis=-1) / np.maximum(total, 1e-12)
    error = np.minimum(1 / np.sqrt(np.maximum(total, 1e-12)), 1.0)
    misfit = observed.log_amplitude - np.maximum(level[..., None] + past, 0.0)
    terms = np.log1p(misfit**2 / (_FREEDOM * variance))
    return -(_FREEDOM + 1) / 2 * terms.sum(axis=-1), level, error
