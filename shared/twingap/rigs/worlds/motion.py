"""Angles of shaft and cage over time, times of impacts, and their force.

mean speed, its deviation -> shaft turns <-> time;  cage ratio, bearing -> orders -> times of impacts
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing

Array = NDArray[np.float64]
GRID_HZ = 2000.0
"""Rate of the grid of angles, Hz. Speed changes within tenths of a second, so angles are interpolated linearly."""


@dataclass(frozen=True)
class Motion:
    """Shaft and cage of one record.

    Parameters
    ----------
    grid_s, grid_turns : Array [points]
        Time from the start of the record (negative while settling) and shaft angle in turns.
    hz : float
        Mean shaft speed over the record.
    cage_ratio : float
        Cage turns per shaft turn.
    cage_start : float
        Cage angle at zero shaft angle, turns.
    """

    grid_s: Array
    grid_turns: Array
    hz: float
    cage_ratio: float
    cage_start: float

    def turns(self, t_s: Array) -> Array:
        """Shaft angle in turns at these times."""
        return np.interp(t_s, self.grid_s, self.grid_turns)

    def time_s(self, turns: Array) -> Array:
        """Times at which the shaft reaches these angles, s."""
        return np.interp(turns, self.grid_turns, self.grid_s)

    def cage(self, turns: Array) -> Array:
        """Cage angle in turns at these shaft angles."""
        return np.asarray(self.cage_ratio * turns + self.cage_start)

    def passes(self, order: float, phase: float) -> Array:
        """Shaft angles, in turns, at which events of this order occur."""
        first, last = np.ceil(order * self.grid_turns[0] + phase), np.floor(order * self.grid_turns[-1] + phase)
        return np.asarray((np.arange(first, last + 1) - phase) / order)


def make_motion(
    speed_rpm: float, start_s: float, end_s: float, cage_ratio: float, deviation: Array | None, start: Array
) -> Motion:
    """Angles of shaft and cage over a record.

    Parameters
    ----------
    speed_rpm : float
        Mean speed over 0 to `end_s`.
    start_s, end_s : float
        Begin (negative) and end of the simulation, s.
    cage_ratio : float
    deviation : Array [points] or None
        Relative deviation of the speed on the grid `grid_s(start_s, end_s)`; its mean over the record is removed.
    start : Array [2]
        Shaft and cage angle at time 0, turns.
    """
    grid = grid_s(start_s, end_s)
    hz = speed_rpm / 60
    if deviation is None:
        turns = hz * grid
    else:
        inside = (grid >= 0) & (grid <= end_s)
        rate = hz * np.maximum(1 + deviation - deviation[inside].mean(), 0.05)
        turns = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * (grid[1] - grid[0])
        turns -= np.interp(0.0, grid, turns)
    return Motion(grid, turns + start[0], hz, cage_ratio, float(start[1]))


def grid_s(start_s: float, end_s: float) -> Array:
    """Times of the grid of angles [points], s."""
    return np.linspace(start_s, end_s, max(2, int(np.ceil((end_s - start_s) * GRID_HZ)) + 1))


def fault_order(bearing: Bearing, fault: str, cage_speed_ratio: float) -> float:
    """Impacts per shaft turn when the cage runs at `cage_speed_ratio` times its kinematic speed.

    Rolling without slip at the inner ring: BPFO = Z c, BPFI = Z (1 - c), spin as (1 - c), c = cage turns per turn.
    """
    cage = bearing.ftf * cage_speed_ratio
    if fault == "inner":
        return bearing.n_rollers * (1 - cage)
    if fault == "outer":
        return bearing.n_rollers * cage
    return bearing.fault_order("ball") * (1 - cage) / (1 - bearing.ftf)


def deposit(
    time_s: Array, area: Array, duration_s: Array, start_s: float, n: int, rate_hz: float, hertz: bool
) -> Array:
    """Force over time of pulses that begin between grid points, as its mean over each cell of the grid.

    Cell means preserve the impulse of every pulse and, to second order, its time.

    Parameters
    ----------
    time_s, area, duration_s : Array [pulses]
        Begin, s, impulse and duration, s, of each pulse.
    start_s : float
        Begin of the first cell, s.
    n : int
        Number of cells.
    rate_hz : float
        Cells per second.
    hertz : bool
        Whether the pulse is sin(pi s)^(3/2), as of a Hertzian contact; otherwise sin(pi s)^2.

    Returns
    -------
    Array [cells]
        Impulse per second.
    """
    keep = (time_s > start_s) & (time_s < start_s + n / rate_hz)
    if not keep.any():
        return np.zeros(n)
    begin, area, length = (time_s[keep] - start_s) * rate_hz, area[keep], duration_s[keep] * rate_hz
    first = np.floor(begin).astype(np.int64)
    width = int(np.ceil(length.max())) + 1
    edges = (first[:, None] + np.arange(width + 1) - begin[:, None]) / length[:, None]
    done = np.interp(edges, *(_HERTZ if hertz else _SMOOTH))  # fraction of the impulse before each edge
    cells = first[:, None] + np.arange(width)
    inside = cells < n
    values = (area[:, None] * np.diff(done, axis=1))[inside] * rate_hz
    return np.asarray(np.bincount(cells[inside], weights=values, minlength=n), dtype=np.float64)


def _running(power: float) -> tuple[Array, Array]:
    """Cumulative fraction of a pulse's impulse over the fraction of its duration."""
    s = np.linspace(0.0, 1.0, 513)
    shape = np.sin(np.pi * s) ** power
    total = np.concatenate([[0.0], np.cumsum(0.5 * (shape[1:] + shape[:-1]))])
    return s, total / total[-1]


_HERTZ, _SMOOTH = _running(1.5), _running(2.0)
