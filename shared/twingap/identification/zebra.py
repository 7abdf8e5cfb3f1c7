"""The Zebra Optimisation Algorithm, after its authors' code.

herd --> phase 1: toward the pioneer (the best) --> keep what is better --> phase 2: flee, or gather around one --> ...

Source: Trojovska, Dehghani and Trojovsky, Zebra Optimization Algorithm, IEEE Access 10 (2022) 49445,
doi:10.1109/ACCESS.2022.3172789, and the code that its authors published. R is 0.1 there and 0.01 in several ports,
so it is `reach`. One port has 2 + r - 1 where the authors have 2 r - 1; this follows the authors.

Steps are not invariant to a shift of the coordinates. Phase 1 moves by r (PZ - I x), which for I = 2 and a converged
herd is about -r x: far outside a box that is far from zero, and clipped to its lower edge. Fleeing also scales with x.
Results therefore depend on the origin; here the coordinates are ln K, K in N/m^1.5, and ln c.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Zebra:
    """Zebra optimisation, callable as an `Optimiser`.

    Parameters
    ----------
    reach : float
        R: step of the flight from a lion at the first iteration, relative to the coordinates.
    herd : int
        Number of zebras.

    Notes
    -----
    The herd needs `herd` evaluations at first and twice as many per iteration. A phase evaluates all zebras at once,
    since they do not depend on each other within it. Where the evaluations end within a phase, the other zebras do not
    move.
    """

    reach: float = 0.1
    herd: int = 16

    def __call__(
        self,
        objective: Callable[[Array], Array],
        bounds: Array,
        rng: np.random.Generator,
        evaluations: int,
    ) -> Array:
        """The best point of just so many evaluations; see `Optimiser`."""
        low, high = np.asarray(bounds, float).T
        iterations = max(1, -(-(evaluations - self.herd) // (2 * self.herd)))
        x = low + (high - low) * rng.random((self.herd, low.size))
        values = np.full(self.herd, np.inf)
        left = evaluations

        def settle(wanted: Array) -> None:
            """Move each zebra there if that is no worse."""
            nonlocal left
            tried = np.clip(wanted[:left], low, high)
            left -= len(tried)
            if len(tried):
                found = np.asarray(objective(tried), float)
                better = np.flatnonzero(found <= values[: len(tried)])
                x[better], values[better] = tried[better], found[better]

        settle(x)
        for t in range(1, iterations + 1):
            pioneer = x[int(np.argmin(values))].copy()
            settle(forage(x, pioneer, rng.random(x.shape), whole(rng, self.herd)))
            if rng.random() < 0.5:
                settle(flee(x, self.reach, t / iterations, rng.random(x.shape)))
            else:
                attacked = x[rng.integers(self.herd)].copy()
                settle(forage(x, attacked, rng.random(x.shape), whole(rng, self.herd)))
        return np.asarray(x[int(np.argmin(values))])


def forage(x: Array, toward: Array, r: Array, i: Array) -> Array:
    """x + r (toward - I x): after the pioneer (phase 1), or to the zebra that is attacked (phase 2, against hyenas).

    Parameters
    ----------
    x, r : Array [zebras, dimensions]
        r between 0 and 1.
    toward : Array [dimensions]
    i : Array [zebras]
        1 or 2 each.
    """
    return np.asarray(x + r * (toward - i[:, None] * x))


def flee(x: Array, reach: float, elapsed: float, r: Array) -> Array:
    """x + R (2 r - 1) (1 - t / T) x: away from a lion (phase 2), less and less far.

    Parameters
    ----------
    x, r : Array [zebras, dimensions]
    reach : float
        R.
    elapsed : float
        t / T.
    """
    return np.asarray(x + reach * (2 * r - 1) * (1 - elapsed) * x)


def whole(rng: np.random.Generator, zebras: int) -> Array:
    """I of each zebra, 1 or 2 with even chances [zebras]: round(1 + rand) in the authors' code."""
    return rng.integers(1, 3, zebras).astype(float)
