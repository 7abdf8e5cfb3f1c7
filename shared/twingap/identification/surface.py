"""Minimum of a quadratic surface through a grid of points, and its scatter.

grid around the best point --objective--> values --least squares--> quadratic --> minimum
    same grid, some data left out ------> other values ----------> quadratic --> minimum --> jackknife

The objective compares simulations with data. Where data or trajectories are left out, the simulations are reused, so
that intervals need no further simulations.
"""

from __future__ import annotations

from itertools import combinations_with_replacement, product

import numpy as np
from numpy.typing import NDArray

from twingap.identification.intervals import Spread

Array = NDArray[np.float64]


def grid(dimensions: int, side: int = 5) -> Array:
    """Points of [-1, 1]^dimensions, `side` per edge [points, dimensions]."""
    return np.array(list(product(np.linspace(-1, 1, side), repeat=dimensions)))


def quadratic(at: Array, values: Array) -> tuple[float, Array, Array]:
    """Least-squares quadratic through values.

    Parameters
    ----------
    at : Array [points, dimensions]
    values : Array [points]

    Returns
    -------
    float, Array [dimensions], Array [dimensions, dimensions]
        a, b and H of a + b x + x H x / 2.
    """
    d = at.shape[1]
    found = np.linalg.lstsq(_columns(at), values, rcond=None)[0]
    hessian = np.zeros((d, d))
    for (i, j), value in zip(combinations_with_replacement(range(d), 2), found[1 + d :], strict=True):
        hessian[i, j] += value
        hessian[j, i] += value
    return float(found[0]), np.asarray(found[1 : 1 + d], float), hessian


def lowest(at: Array, values: Array) -> Array | None:
    """Minimum of the quadratic through values [dimensions]; None without a minimum, or where it is far outside."""
    _, slope, hessian = quadratic(at, values)
    if np.linalg.eigvalsh(hessian)[0] <= 1e-9 * np.abs(values).max():
        return None
    place = -np.linalg.solve(hessian, slope)
    return np.asarray(place) if np.abs(place).max() <= 3 else None


def value_at(at: Array, values: Array, place: Array) -> float:
    """Value of the quadratic through values [points], at a point [dimensions]."""
    found = np.linalg.lstsq(_columns(at), values, rcond=None)[0]
    return float((_columns(place[None]) @ found)[0])


def spread(without: Array) -> Spread:
    """Jackknife spread from estimates with one part left out each.

    Parameters
    ----------
    without : Array [parts, estimates]
    """
    parts = len(without)
    variance = (parts - 1) / parts * np.sum((without - without.mean(axis=0)) ** 2, axis=0)
    return Spread(variance, np.full(variance.shape, parts - 1.0))


def _columns(at: Array) -> Array:
    pairs = combinations_with_replacement(range(at.shape[1]), 2)
    return np.column_stack([np.ones(len(at)), at, *(at[:, i] * at[:, j] for i, j in pairs)])
