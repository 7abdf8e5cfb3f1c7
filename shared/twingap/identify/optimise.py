"""Optimisers that search a box for the least of an objective; which one is used is nobody else's business."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Objective = Callable[[Array], Array]
"""Points [points, dimensions] -> values [points], all points at once; infinite where a point makes no sense."""


class Optimiser(Protocol):
    """How a minimum is sought.

    Parameters
    ----------
    objective : Objective
    bounds : Array [dimensions, 2]
    rng : numpy.random.Generator
    evaluations : int
        At most about so many points are tried.

    Returns
    -------
    Array [dimensions]
        The best point found.
    """

    def __call__(self, objective: Objective, bounds: Array, rng: np.random.Generator, evaluations: int) -> Array: ...


def differential_evolution(
    objective: Objective, bounds: Array, rng: np.random.Generator, evaluations: int = 320
) -> Array:
    """Differential evolution (Storn and Price 1997) as in SciPy, a generation at a time, from a Latin hypercube."""
    from scipy.optimize import differential_evolution as search

    # SciPy makes popsize x dimensions members; a small crowd and many generations suit two smooth dimensions.
    crowd = 8
    generations = max(1, evaluations // (crowd * len(bounds)) - 1)

    def values(points: Array) -> Array:
        found = objective(points.T)
        return np.where(np.isfinite(found), found, 1e30)

    found = search(
        cast(Any, values),  # vectorized: SciPy's own annotation knows scalars only
        cast(Any, [(float(lo), float(hi)) for lo, hi in bounds]),
        popsize=crowd,
        maxiter=generations,
        rng=rng,
        tol=1e-3,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return np.asarray(found.x)
