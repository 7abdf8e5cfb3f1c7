"""Minimum of the contact twin's objective near the optimiser's best point, with intervals.

best point --grid of points, several sets of trajectories--> quadratic surface --> its minimum --> repeated until
accepted
                                                                 |
    one block of records or one set of trajectories left out in turn --> jackknife --> intervals

An estimate scatters with the measured records and with the random initial angles of the simulated trajectories. Both
are independent, so their variances add. Effects that the twin lacks are not included: intervals hold for records of the
twin as given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from twingap.identification.contact_objective import SpectrumObjective
from twingap.identification.intervals import Spread
from twingap.identification.result import Estimate
from twingap.identification.surface import grid, lowest, quadratic, spread, value_at

Array = NDArray[np.float64]
Parts = list[Array]
T = TypeVar("T")

SETS: Final = 6
"""Fewest sets of trajectories with different initial angles; more give better intervals and are slower."""
TRAJECTORIES: Final = 48
"""Fewest trajectories of a state in all sets together; fewer increase the scatter of damping."""
ROUNDS: Final = 10
"""Most grids; more find minima that are further from the start."""
RISE: Final = 0.3
"""Desired increase of the squared error from the centre of the grid to its edge, relative to its minimum; larger makes
grids wider, where the surface is less quadratic."""
RADIUS: Final = np.array([[0.001, 0.02, 0.1], [0.005, 0.07, 0.4]])
"""Smallest, first and largest half width of the grid, in ln stiffness and ln damping."""
OWN: Final = np.array([0.001, 0.005, 0.005, 0.005, 0.005])
"""Standard deviations of the logarithms of `NAMES` due to the method (the surface is not exactly quadratic, powers are
not negative), from simulated machines. They are added to the scatter of records and trajectories."""
NOTHING: Final = 1e-12
"""Power of the contact relative to that of the noises where records contain no contact."""
NAMES: Final = ("stiffness", "damping", "scale", "structure_noise_rms", "white_noise_rms")


@dataclass(frozen=True)
class Bottom:
    """Minimum of the objective.

    Parameters
    ----------
    point : Array [2]
        ln stiffness, ln damping.
    error : float
        Relative error of the amplitude spectra.
    powers : Array [3]
        scale^2, structure noise, white noise, in record units squared.
    parts : list of Array [3, bins]
        PSDs of each state that are multiplied by the powers.
    scatter : Spread or None
        Standard errors of the logarithms of `NAMES`; None where they could not be determined.
    """

    point: Array
    error: float
    powers: Array
    parts: Parts
    scatter: Spread | None

    def estimates(self, level: float) -> dict[str, Estimate]:
        """Values with intervals at this level; without intervals where records contain no contact."""
        if self.powers[0] == 0:
            values = _values(self.point, np.array([NOTHING * self.powers.sum(), *self.powers[1:]]))
            return {name: Estimate(float(v)) for name, v in zip(NAMES, values, strict=True)}
        values = _values(self.point, self.powers)
        out = {}
        for place, (name, value) in enumerate(zip(NAMES, values, strict=True)):
            interval = None
            if self.scatter is not None and value > 0 and np.isfinite(self.scatter.variance[place]):
                low, high = np.exp(self.scatter.at(place).interval(np.log([value]), level)[0])
                interval = (float(low), float(high))
            out[name] = Estimate(float(value), interval)
        return out


def descend(
    objective: SpectrumObjective, start: Array, places: Sequence[int], rng: np.random.Generator, notes: list[str]
) -> Bottom:
    """Local minimum of the objective from a starting point.

    Parameters
    ----------
    objective : SpectrumObjective
    start : Array [2]
        ln stiffness and ln damping of a point that can be simulated.
    places : sequence of int
        Indices of the free coordinates.
    rng : numpy.random.Generator
        Generator of the initial angles of trajectories.
    notes : list of str
        List to which a note is added where intervals are missing.
    """
    free, steps = list(places), grid(len(places))
    sets = [
        SpectrumObjective(objective.twin, objective.states, rng.random(objective.starts.shape), objective.levels)
        for _ in range(max(SETS, -(-TRAJECTORIES // min(len(state.conditions) for state in objective.states))))
    ]
    centre, radius, best = start.copy(), RADIUS[free, 1], start
    for _ in range(ROUNDS):
        points = np.tile(centre, (len(steps), 1))
        points[:, free] += radius * steps
        surface = _Surface(objective, sets, points, steps)
        if len(surface.at) < 2 * (1 + len(free)) ** 2:
            break
        squares = surface.squares()
        place, best = surface.lowest(squares), surface.points[int(np.argmin(squares))]
        if place is None:
            at_edge = np.abs(surface.at[int(np.argmin(squares))]) == 1
            centre, radius = best, np.clip(radius * np.where(at_edge, 2, 0.5), RADIUS[free, 0], RADIUS[free, 2])
            continue
        bend = np.maximum(np.diag(quadratic(surface.at, squares)[2]), 1e-300)
        wanted = np.clip(radius * np.sqrt(2 * RISE * squares.min() / bend), RADIUS[free, 0], RADIUS[free, 2])
        if np.any(wanted < radius / 2):
            # The grid is too wide for a quadratic; its best point is a safer centre.
            centre, radius = best, np.clip(wanted, radius / 3, radius)
            continue
        if np.all(np.abs(place) <= 1) and np.all(wanted < 2 * radius):
            found = centre.copy()
            found[free] += radius * place
            below, above = _at(objective, sets, found), _must(_at(objective, sets, start))
            if below is None or below.error**2 > (1 + RISE / 3) * above.error**2:
                centre, radius = best, radius / 2  # not yet quadratic
                continue
            scatter = surface.scatter(place, radius, free)
            if scatter is None:
                notes.append("no intervals: too few records to estimate their scatter, or too flat a minimum")
            return Bottom(found, below.error, below.powers, below.parts, scatter)
        centre = centre.copy()
        centre[free] += radius * np.clip(place, -1.5, 1.5)
        radius = np.minimum(wanted, 3 * radius)
    notes.append("no intervals: around the best point found the error of the spectra has no smooth minimum")
    ends = [_must(_at(objective, sets, point)) for point in (start, best)]
    return min(ends, key=lambda bottom: bottom.error)


class _Surface:
    """Simulated spectra on a grid of points, for comparison with different parts of the records.

    Parameters
    ----------
    objective : SpectrumObjective
    sets : sequence of SpectrumObjective
        Objectives that differ in the initial angles of trajectories.
    points : Array [points, 2]
    steps : Array [points, free]
        The same points in units of the grid.
    """

    def __init__(
        self, objective: SpectrumObjective, sets: Sequence[SpectrumObjective], points: Array, steps: Array
    ) -> None:
        made = [each.components([each.parameters(p) for p in points]) for each in sets]
        # Whether a point can be simulated does not depend on initial angles.
        self.kept = [i for i, parts in enumerate(made[0]) if parts is not None]
        self.made: list[list[Parts]] = [[_must(one[i]) for i in self.kept] for one in made]
        self.objective, self.points, self.at = objective, points[self.kept], steps[self.kept]

    def match(self, left_out: int | None = None, psds: Sequence[Array] | None = None) -> tuple[Array, Array]:
        """Squared errors [points] and powers [points, 3], optionally without one set or for other spectra."""
        used = [one for number, one in enumerate(self.made) if number != left_out]
        found = [self.objective.match(_mean([one[i] for one in used]), psds) for i in range(len(self.at))]
        return np.array([error**2 for error, _ in found]), np.array([powers for _, powers in found])

    def squares(self) -> Array:
        """Squared errors [points]."""
        return self.match()[0]

    def lowest(self, squares: Array) -> Array | None:
        """Minimum of the squared errors in units of the grid; None where there is none."""
        return lowest(self.at, squares) if self.at.shape[1] else np.empty(0)

    def scatter(self, place: Array, radius: Array, free: Sequence[int]) -> Spread | None:
        """Jackknife over blocks of each state's records and over sets of trajectories."""
        total = None
        psds = [state.psd for state in self.objective.states]
        for number, state in enumerate(self.objective.states):
            if len(state.without) < 2:
                return None
            other = [[*psds[:number], row, *psds[number + 1 :]] for row in state.without]
            part = self._spread([self.match(psds=each) for each in other], radius, free)
            if part is None:
                return None
            total = part if total is None else total + part
        part = self._spread([self.match(left_out=number) for number in range(len(self.made))], radius, free)
        if part is None or total is None:
            return None
        return total + part + Spread(OWN**2, np.full(OWN.size, 60.0))

    def _spread(self, matched: Sequence[tuple[Array, Array]], radius: Array, free: Sequence[int]) -> Spread | None:
        rows = []
        for squares, powers in matched:
            place = self.lowest(squares)
            if place is None:
                return None
            point = np.zeros(2)
            point[list(free)] = radius * place
            at = np.maximum([value_at(self.at, column, place) for column in powers.T], 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                rows.append(np.log(_values(point, at)))
        return spread(np.where(np.isfinite(rows), rows, np.nan))


def _at(objective: SpectrumObjective, sets: Sequence[SpectrumObjective], point: Array) -> Bottom | None:
    made = [each.components([each.parameters(point)])[0] for each in sets]
    if made[0] is None:
        return None
    parts = _mean([_must(one) for one in made])
    error, powers = objective.match(parts)
    return Bottom(point, error, powers, parts, None)


def _values(point: Array, powers: Array) -> Array:
    """Values of `NAMES`; noises are relative to scale."""
    scale, structure, white = np.sqrt(powers)
    return np.array([*np.exp(point), scale, structure / scale, white / scale])


def _mean(sets: Sequence[Parts]) -> Parts:
    return [np.mean(parts, axis=0) for parts in zip(*sets, strict=True)]


def _must(value: T | None) -> T:
    assert value is not None
    return value
