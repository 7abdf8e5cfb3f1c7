"""Usual estimators of remaining life for comparison: each causal, with the same input as the online estimator.

They share the health indicator, the alarm and the end level with `online`, so that what differs is the prediction
alone; and what other runs say (a usual life after the onset) where their own model has no answer.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from papers.arrays import Array
from papers.paper1_rul_varying_speed.methods.degradation import fit_damage
from twingap import TwingapError


@dataclass(frozen=True)
class Growth:
    """A run since the onset of its anomaly, and what is known of its end."""

    revolutions: Array  # [rows] since the onset, 0 at its first row
    log_amplitude: Array  # [rows] natural logarithm of normalised amplitude
    scatter: float  # standard deviation of healthy log amplitude
    first: int  # row at which the alarm is given: the first with a prediction
    end: float  # log amplitude at the end of life
    usual_life: float  # revolutions that other runs lasted from onset to end


def exponential_extrapolation(growth: Growth) -> Array:
    """Least squares of log amplitude since the onset (eq. 12 with a free level), carried on to the end: remaining
    revolutions [rows]; NaN before the alarm. What is left of the usual life where no growth was fitted or its end lies
    beyond ten usual lives."""
    found = np.full(growth.revolutions.size, np.nan)
    for row in range(growth.first, growth.revolutions.size):
        u = growth.revolutions[: row + 1]
        usual = max(growth.usual_life - u[-1], 0.0)
        # The onset itself is left out by `fit_damage`: rows "after" it are meant.
        try:
            fit = fit_damage(u, np.exp(growth.log_amplitude[: row + 1]), -1e-9, level="free")
        except TwingapError:
            found[row] = usual
            continue
        left = growth.end - np.log(fit.level) - fit.rate * (u[-1] + 1e-9)
        beyond = fit.rate <= 0 or left / fit.rate > 10 * growth.usual_life
        found[row] = max(usual if beyond else left / fit.rate, 0.0)
    return found


def particle_filter(growth: Growth, rng: np.random.Generator, particles: int = 1000) -> tuple[Array, Array, Array]:
    """Bootstrap filter of (log amplitude, log rate) under eq. 12 (Gordon, Salmond, Smith 1993, DOI
    10.1049/ip-f-2.1993.0015): median, low and high end of the 90 % interval of remaining revolutions [rows]; NaN before
    the alarm. The rate begins about that of a usual life and wanders by a tenth a row, but not in the future; a median
    beyond ten usual lives gives way to what is left of the usual life."""
    u, x = growth.revolutions, growth.log_amplitude
    out = np.full((3, u.size), np.nan)
    level = x[0] + growth.scatter * rng.normal(size=particles)
    rate = np.log(max(growth.end, 0.1) / max(growth.usual_life, 1e-9)) + rng.normal(size=particles)
    scatter = max(growth.scatter, 0.02)
    for row in range(u.size):
        if row:
            step = u[row] - u[row - 1]
            rate = rate + 0.1 * rng.normal(size=particles)
            level = level + np.minimum(np.exp(rate) * step, 5.0) + 0.02 * rng.normal(size=particles)
        weight = -2.5 * np.log1p(((x[row] - level) / scatter) ** 2 / 4)
        weight = np.exp(weight - weight.max())
        places = (np.arange(particles) + rng.uniform()) / particles
        chosen = np.minimum(np.searchsorted(np.cumsum(weight) / weight.sum(), places), particles - 1)
        level, rate = level[chosen], rate[chosen]
        if row >= growth.first:
            left = np.maximum(growth.end - level, 0.0) / np.exp(rate)
            out[:, row] = np.quantile(left, (0.5, 0.05, 0.95))
            if out[0, row] > 10 * growth.usual_life:
                out[0, row] = max(growth.usual_life - u[row], 0.0)
    return out[0], out[1], out[2]


def causal_features(columns: ArrayLike, revolutions: ArrayLike, healthy_rows: int = 60) -> Array:
    """Features [rows, 4 features + 1] from the rows up to each: logarithm of positive `columns` over the median of the
    healthy rows so far, its means over 5 and 30 rows, the greatest such mean so far; revolutions."""
    x = np.log(np.maximum(np.asarray(columns, float), 1e-12))
    u = np.asarray(revolutions, float)
    base = np.array([np.nanmedian(x[: min(row + 1, healthy_rows)], axis=0) for row in range(min(len(x), healthy_rows))])
    base = np.concatenate((base, np.repeat(base[-1:], max(len(x) - healthy_rows, 0), axis=0)))
    total = np.concatenate((np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)))
    rows = np.arange(1, len(x) + 1)
    firsts = (np.maximum(rows - width, 0) for width in (5, 30))
    means = [(total[rows] - total[first]) / (rows - first)[:, None] - base for first in firsts]
    return np.column_stack((x - base, *means, np.maximum.accumulate(means[0], axis=0), u))


def random_forest(
    train: Sequence[tuple[Array, Array]], features: Array, seed: int, trees: int = 200
) -> tuple[Array, Array, Array]:
    """Regression forest (Breiman 2001, DOI 10.1023/A:1010933404324) on features [rows, features] and remaining
    revolutions [rows] of runs that ended, each of the same weight: mean over trees, 5 % and 95 % of single trees
    [rows]."""
    from sklearn.ensemble import RandomForestRegressor

    x, y = (np.concatenate([run[place] for run in train]) for place in (0, 1))
    weight = np.concatenate([np.full(len(r), 1 / len(r)) for _, r in train])
    forest = RandomForestRegressor(trees, min_samples_leaf=5, max_features=1 / 3, random_state=seed, n_jobs=1)
    forest.fit(x, y, sample_weight=weight / weight.mean())
    each = np.stack([tree.predict(features) for tree in forest.estimators_])
    low, high = np.quantile(each, (0.05, 0.95), axis=0)
    return np.asarray(each.mean(axis=0)), np.asarray(low), np.asarray(high)
