"""Derivative-free optimisers of an objective on a box.

objective, bounds, rng, evaluations --> OPTIMISERS[name] --> best point
objective --Traced--> objective with a record of points and values --> cost over evaluations

All use exactly the given number of evaluations, so that they can be compared at equal cost, and evaluate populations of
points, since the objective simulates many at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.identification.zebra import Zebra

Array = NDArray[np.float64]

Objective = Callable[[Array], Array]
"""Points [points, dimensions] -> values [points], all points at once; infinite where a point is impossible."""

WORST: Final = 1e30
"""Finite value in place of infinity, for optimisers that need one."""


class Optimiser(Protocol):
    """Derivative-free optimiser.

    Parameters
    ----------
    objective : Objective
    bounds : Array [dimensions, 2]
    rng : numpy.random.Generator
    evaluations : int
        Number of points to evaluate.

    Returns
    -------
    Array [dimensions]
        Best point.
    """

    def __call__(self, objective: Objective, bounds: Array, rng: np.random.Generator, evaluations: int) -> Array: ...


class Traced:
    """Objective that records its points and values.

    Parameters
    ----------
    objective : Objective
    """

    def __init__(self, objective: Objective) -> None:
        self.objective = objective
        self._points: list[Array] = []
        self._values: list[Array] = []

    def __call__(self, points: Array) -> Array:
        """Values of the objective [points]."""
        values = np.asarray(self.objective(points), float)
        self._points.append(np.array(points))
        self._values.append(values)
        return values

    @property
    def points(self) -> Array:
        """All points in order [evaluations, dimensions]."""
        return np.concatenate(self._points)

    @property
    def values(self) -> Array:
        """All values [evaluations]."""
        return np.concatenate(self._values)

    @property
    def best(self) -> Array:
        """Smallest value after each evaluation [evaluations]."""
        return np.asarray(np.minimum.accumulate(self.values))


def differential_evolution(
    objective: Objective, bounds: Array, rng: np.random.Generator, evaluations: int = 320
) -> Array:
    """Differential evolution (Storn and Price 1997) as in SciPy, by generations, from a Latin hypercube.

    All evaluations are used; members of the last generation beyond them are rejected without evaluation.
    """
    from scipy.optimize import differential_evolution as search

    # SciPy makes popsize x dimensions members; few members and many generations suit two smooth dimensions.
    crowd, left = 8, evaluations
    generations = max(0, -(-evaluations // (crowd * len(bounds))) - 1)

    def values(points: Array) -> Array:
        nonlocal left
        found = np.full(points.shape[1], WORST)
        tried = min(left, found.size)
        left -= tried
        if tried:
            found[:tried] = _finite(objective(points.T[:tried]))
        return found

    found = search(
        cast(Any, values),  # vectorized: SciPy annotates scalars only
        cast(Any, [(float(lo), float(hi)) for lo, hi in bounds]),
        popsize=crowd,
        maxiter=generations,
        rng=rng,
        tol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return np.asarray(found.x)


def random_search(objective: Objective, bounds: Array, rng: np.random.Generator, evaluations: int = 320) -> Array:
    """Uniform random search, as a baseline for other optimisers."""
    points = bounds[:, 0] + (bounds[:, 1] - bounds[:, 0]) * rng.random((evaluations, len(bounds)))
    values = [objective(points[at : at + 16]) for at in range(0, evaluations, 16)]
    return np.asarray(points[int(np.argmin(_finite(np.concatenate(values))))])


OPTIMISERS: Final[Mapping[str, Optimiser]] = {
    "zoa": Zebra(reach=0.1),
    "zoa-ports": Zebra(reach=0.01),
    "differential-evolution": differential_evolution,
    "random": random_search,
}
"""Optimisers by their names on the command line. R of Zebra is 0.1 in its authors' code and 0.01 in several ports."""

DEFAULT: Final = "differential-evolution"


def optimiser_of(name: str) -> Optimiser:
    """Optimiser with a given name.

    Raises
    ------
    TwingapError
        For an unknown name.
    """
    if name not in OPTIMISERS:
        raise TwingapError(f"unknown optimiser {name!r}", where="identification", mend=f"use {', '.join(OPTIMISERS)}")
    return OPTIMISERS[name]


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, WORST)
