"""Posterior over growth laws of amplitude, and over remaining revolutions, from the growth seen so far.

log amplitude over revolutions, healthy = 0 --> weights of laws (rate r, curvature q) --+
level at which life ends ---------------------------------------------------------------+--> weighted lives

The family d(log D)/du = r exp(q (log D - l)) with r the relative growth per revolution at the present level l holds the
usual laws: q = 0 the exponential of eq. 12 of paper 1, q = -1 linear growth, -1 < q < 0 powers of time, q > 0 growth
that runs away as Paris' law does (dD/du = a D^(q + 1)). Anchored at the present row, both its past and its future are
closed forms, and only their shape, not the unknown onset, has to be searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CURVATURES = np.array([-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.5])
_CURVATURE_PRIOR = np.log([0.10, 0.15, 0.25, 0.20, 0.15, 0.10, 0.05])
_COARSE = np.geomspace(0.01, 100.0, 33)
"""Rates tried, per revolutions since the onset: a scale-free prior, flat in log r."""
_NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
_NODE_LOGS = np.log([1 / 6, 2 / 3, 1 / 6])
_FREEDOM = 4.0
_LOWEST = -12.0
_NEAR, _FAR = 0.1, 0.6
"""Deviation of a run from any one law, in log amplitude: now, and at the onset. Greater values widen intervals; these
give narrow ones after calibration on simulated runs."""
_EARLY = 0.7
"""Of the greatest of n normal deviates, sqrt(2 log n), that which comes where amplitude goes on growing."""


@dataclass(frozen=True)
class Seen:
    """Input of the filter from a run at a row.

    Parameters
    ----------
    ago : Array [bins]
        Revolutions before the present row, not negative.
    log_amplitude : Array [bins]
        Natural logarithm of normalised amplitude.
    variance : Array [bins]
        Of it, by scatter alone.
    after_onset : NDArray[bool] [bins]
    since_onset : float
        Revolutions from the onset to the present row, above 0.
    scatter : float
        Standard deviation of one row's log amplitude.
    per_row : float
        Revolutions from row to row.
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
    """Weighted remaining revolutions.

    Parameters
    ----------
    revolutions : Array [n]
        Increasing.
    cumulated : Array [n]
        Weight up to the middle of each, 0 to 1.
    level : float
        Mean present log amplitude.
    """

    revolutions: Array
    cumulated: Array
    level: float

    def quantile(self, share: float) -> float:
        """Remaining revolutions that a share of the weight does not exceed."""
        return float(np.interp(share, self.cumulated, self.revolutions))


def shape(ago: Array, rate: Array, curvature: Array) -> Array:
    """Log amplitude of the law at `ago` revolutions before now, relative to now: not above 0.

    Parameters
    ----------
    ago : Array [bins]
    rate : Array [...]
        r, per revolution.
    curvature : Array [...]
        q.

    Returns
    -------
    Array [..., bins]
        Very low where the law had not begun yet.
    """
    back = rate[..., None] * ago
    q = curvature[..., None]
    inner = 1 + q * back
    bent = -np.log(np.maximum(inner, 1e-12)) / np.where(q == 0, 1.0, q)
    return np.maximum(np.where(q == 0, -back, np.where(inner > 0, bent, _LOWEST)), _LOWEST)


def remaining(distance: Array, rate: Array, curvature: Array) -> Array:
    """Revolutions in which a law grows by `distance` (log amplitude), broadcast over all; 0 when nothing is missing."""
    d = np.maximum(distance, 0.0)
    bent = -np.expm1(-curvature * d) / np.where(curvature == 0, 1.0, curvature)
    return np.asarray(np.where(curvature == 0, d, bent) / rate)


def lives(seen: Seen, end: float) -> Lives:
    """Posterior of remaining revolutions.

    Parameters
    ----------
    seen : Seen
    end : float
        Log amplitude at which life ends.

    Returns
    -------
    Lives
        By summation over a grid of rates, refined once about where the weight lies, curvatures, and the present level
        (3-point Gauss-Hermite about its weighted mean under each law). Scatter is taken to have Student's t with 4
        degrees of freedom. Life ends at the first row beyond the end level, and scatter makes that come early: the
        level is lowered by the greatest deviation to be expected of the rows that are near it.
    """
    rates = _COARSE / seen.since_onset
    weight = _evidence(seen, rates)[0]
    mass = np.exp(weight - weight.max()).sum(axis=1)
    reached = np.flatnonzero(mass > 1e-4 * mass.max())
    rates = np.geomspace(rates[max(reached[0] - 1, 0)], rates[min(reached[-1] + 1, rates.size - 1)], 33)
    weight, level, error = _evidence(seen, rates)
    now = level[..., None] + error[..., None] * _NODES
    logs = (weight + _CURVATURE_PRIOR)[..., None] + _NODE_LOGS
    r, q = rates[:, None, None], CURVATURES[:, None]
    growth = r * np.exp(np.clip(q * (end - now), -20, 20)) * seen.per_row
    early = seen.scatter * _EARLY * np.sqrt(2 * np.log1p(seen.scatter / np.maximum(growth, 1e-12)))
    left = remaining(end - early - now, r, q)
    w = np.exp(logs - logs.max()).ravel()
    w /= w.sum()
    order = np.argsort(left.ravel(), kind="stable")
    cumulated = np.cumsum(w[order]) - w[order] / 2
    mean = float(np.sum(now.ravel() * w))
    return Lives(left.ravel()[order], cumulated, mean)


def _evidence(seen: Seen, rates: Array) -> tuple[Array, Array, Array]:
    """Log likelihood [rates, curvatures], the present level under each law and its standard error."""
    r, q = np.broadcast_arrays(rates[:, None], CURVATURES[None, :])
    past = shape(seen.ago, r, q)
    variance = seen.variance + _NEAR**2 + (_FAR * seen.ago / seen.since_onset) ** 2
    precise = np.where(seen.after_onset & (past > -3.0), 1 / variance, 0.0)
    total = precise.sum(axis=-1)
    level = np.sum(precise * (seen.log_amplitude - past), axis=-1) / np.maximum(total, 1e-12)
    error = np.minimum(1 / np.sqrt(np.maximum(total, 1e-12)), 1.0)
    misfit = seen.log_amplitude - np.maximum(level[..., None] + past, 0.0)
    terms = np.log1p(misfit**2 / (_FREEDOM * variance))
    return -(_FREEDOM + 1) / 2 * terms.sum(axis=-1), level, error
