"""The contact model's inner loop: fixed-step RK4, sixteen trajectories to a group, one group to a thread.

state, turns [groups, intervals + 1, 16] --> RK4 (oversampling steps per interval) --> ring of accelerations
                                                             --> low-pass FIR --> accelerations [groups, samples, 16]

What makes it fast, and the same to the bit whatever the number of threads and whoever shares the group:

- Sixteen trajectories go through the same instructions, so that the compiler puts them into the lanes of its vector
  registers. The number of rollers is a constant of the compiled code: the loop over rollers is unrolled, and a step
  keeps everything in registers. Lanes never mix, and no fast-math is allowed.
- The contact is solved in the cage's frame, where the rollers stand still: a roller costs two products to project the
  displacement and two to add its force, and no sine or cosine. The cage's own sine and cosine turn by a recurrence
  that is anchored again at every output sample.
- Rollers are evenly spaced, so at most one of them is inside a defect that is narrower than a pitch: the depth is found
  once per evaluation, then given to the roller whose turn it is.

What is left is the square root of delta^1.5 = delta sqrt(delta): the divider unit is busy all the time.
"""

from __future__ import annotations

import math
import threading
from typing import Final

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ONE_AT_A_TIME = threading.Lock()

LANES: Final = 16
"""Trajectories in a group: two AVX-512 or four AVX2 registers of doubles, enough to hide latencies."""

ROWS: Final[dict[str, int]] = {
    name: row
    for row, name in enumerate(
        (
            "half_step",  # half an internal step, s
            "stiffness",  # K / m, N/m^n per kg
            "damping",  # c / m, 1/s
            "clearance",  # u, m
            "force_x",  # F_x / m, m/s^2
            "force_y",  # F_y / m, m/s^2
            "eccentricity",  # e (2 pi)^2, m rad^2 per turn^2
            "depth",  # h, m
            "steepness",  # 1 / (part of the half width over which an edge rises); 1e300 for a hard edge
            "narrowness",  # 1 / (half width), 1 / passes
            "phase_turns",  # passes per shaft turn
            "phase_cage",  # passes per cage turn
            "phase_start",  # passes at zero angles
            "roller_moves",  # 1: pass n is made by roller n (a race's defect); 0: by roller 0 (its own defect)
        )
    )
}
"""Rows of a group's parameters [rows, 16]; everything is per unit of mass."""

FLOPS_OF_A_ROLLER: Final = 13
"""Projection 4, clearance and defect 2, choices 2, delta^1.5 2 and force 4, less what is shared: per evaluation."""

FLOPS_OF_A_STEP: Final = 4 * 28 + 34 + 2 * (30 + 12)
"""Four evaluations (two rotations, two equations of motion), the stages' sums, two depths and rotations."""


@njit(inline="always")
def _turn(f):  # type: ignore[no-untyped-def]
    # cos and sin of 2 pi f: to the nearest quarter turn, then Taylor series that are exact to rounding up to pi / 4.
    quarter = math.floor(4.0 * f + 0.5)
    a = (f - 0.25 * quarter) * 6.283185307179586
    b = a * a
    s = a * (1.0 + b * (-1 / 6 + b * (1 / 120 + b * (-1 / 5040 + b * (1 / 362880 + b * (
        -1 / 39916800 + b * (1 / 6227020800 - b / 1307674368000)))))))  # fmt: skip
    c = 1.0 + b * (-0.5 + b * (1 / 24 + b * (-1 / 720 + b * (1 / 40320 + b * (-1 / 3628800 + b * (
        1 / 479001600 + b * (-1 / 87178291200 + b / 20922789888000)))))))  # fmt: skip
    which = quarter - 4.0 * math.floor(0.25 * quarter)
    odd = which == 1.0 or which == 3.0
    cos, sin = (s if odd else c), (c if odd else s)
    return (-cos if which == 1.0 or which == 2.0 else cos), (-sin if which >= 2.0 else sin)


@njit(inline="always")
def _defect(p, depth, steepness, narrowness, moves, z):  # type: ignore[no-untyped-def]
    # Depth below the roller that is nearest to the defect, and which roller that is.
    n = math.floor(p + 0.5)
    s = (1.0 - abs(p - n) * narrowness) * steepness
    s = s if s > 0.0 else 0.0
    s = s if s < 1.0 else 1.0
    n = n * moves
    return depth * (s * s * s * (10.0 + s * (6.0 * s - 15.0))), n - z * math.floor((n + 0.5) * (1.0 / z))


@njit(inline="always")
def _accelerate(x, y, vx, vy, c, s, depth, roller, stiffness, damping, clearance, fx, fy, along, across, line):  # type: ignore[no-untyped-def]
    xr, yr = x * c + y * s, y * c - x * s
    px, py = 0.0, 0.0
    for j in range(len(along)):
        d = xr * along[j] + yr * across[j] - clearance
        d -= depth if roller == j else 0.0
        d = d if d > 0.0 else 0.0
        q = d * math.sqrt(d) if line is None else d**line
        px += q * along[j]
        py += q * across[j]
    return (
        fx - damping * vx - stiffness * (px * c - py * s),
        fy - damping * vy - stiffness * (px * s + py * c),
    )


@njit
def _filtered(ring, taps, oldest, output, ready):  # type: ignore[no-untyped-def]
    sums = np.zeros(16)
    for tap in range(taps.shape[0] - oldest):
        for lane in range(16):
            sums[lane] += taps[tap] * ring[oldest + tap, lane]
    first = taps.shape[0] - oldest
    for tap in range(oldest):
        for lane in range(16):
            sums[lane] += taps[first + tap] * ring[tap, lane]
    for lane in range(16):
        output[ready, lane] = sums[lane]


@njit
def _run(state, turns, cage, rows, intervals, oversampling, taps, output, along, across, line):  # type: ignore[no-untyped-def]
    z = float(len(along))
    blocks = taps.shape[0] // oversampling
    ring = np.zeros((blocks * oversampling, 16))
    part = 1.0 / oversampling
    # One workspace whose shape the compiler knows: it then sees that rows never overlap, and fills whole vectors.
    # 0-3 state; 4, 5 acceleration and filter sum; 6-9 cage, 10-13 shaft (angle, half-step turn); 14 unbalance;
    # 15, 16 phase and its step over the interval; from 18 the parameters.
    w = np.zeros((32, 16))
    for lane in range(16):
        for row in range(4):
            w[row, lane] = state[row, lane]
        for row in range(14):
            w[18 + row, lane] = rows[row, lane]
    for i in range(intervals):
        for lane in range(16):
            w[5, lane] = turns[i, lane]
            w[15, lane] = turns[i + 1, lane] - w[5, lane]
            w[16, lane] = cage[i, lane]
            w[17, lane] = cage[i + 1, lane] - w[16, lane]
        for lane in range(16):
            t, dt, c, dc = w[5, lane], w[15, lane], w[16, lane], w[17, lane]
            w[6, lane], w[7, lane] = _turn(c - math.floor(c))
            w[8, lane], w[9, lane] = _turn(0.5 * part * dc)
            w[10, lane], w[11, lane] = _turn(t - math.floor(t))
            w[12, lane], w[13, lane] = _turn(0.5 * part * dt)
            speed = dt * part / (2.0 * w[18, lane])
            w[14, lane] = w[24, lane] * speed * speed
            p = w[28, lane] * t + w[29, lane] * c + w[30, lane]
            # Whole rounds of all rollers change nothing, but would cost digits late in a long record.
            w[15, lane] = p - z * math.floor(p / z)
            w[16, lane] = w[28, lane] * dt + w[29, lane] * dc
        place = (i % blocks) * oversampling
        for step in range(oversampling):
            u0, u1, u2 = step * part, (step + 0.5) * part, (step + 1) * part
            for lane in range(16):
                g, k, cm = w[18, lane], w[19, lane], w[20, lane]
                gap, fx, fy = w[21, lane], w[22, lane], w[23, lane]
                deep, steep, narrow, moves = w[25, lane], w[26, lane], w[27, lane], w[31, lane]
                h, rc, rs = 2.0 * g, w[8, lane], w[9, lane]
                c0, s0 = w[6, lane], w[7, lane]
                c1, s1 = c0 * rc - s0 * rs, s0 * rc + c0 * rs
                c2, s2 = c1 * rc - s1 * rs, s1 * rc + c1 * rs
                qc, qs, unbalance = w[12, lane], w[13, lane], w[14, lane]
                d0, e0 = w[10, lane], w[11, lane]
                d1, e1 = d0 * qc - e0 * qs, e0 * qc + d0 * qs
                d2, e2 = d1 * qc - e1 * qs, e1 * qc + d1 * qs
                p, dp = w[15, lane], w[16, lane]
                b0, j0 = _defect(p + dp * u0, deep, steep, narrow, moves, z)
                b1, j1 = _defect(p + dp * u1, deep, steep, narrow, moves, z)
                b2, j2 = _defect(p + dp * u2, deep, steep, narrow, moves, z)
                x, y, vx, vy = w[0, lane], w[1, lane], w[2, lane], w[3, lane]
                fx0, fy0 = fx + unbalance * d0, fy + unbalance * e0
                fx1, fy1 = fx + unbalance * d1, fy + unbalance * e1
                fx2, fy2 = fx + unbalance * d2, fy + unbalance * e2
                # Classical RK4 for x'' = a: the stages' velocities are (vx, vy), (ux, uy), (wx, wy), (zx, zy).
                ax, ay = _accelerate(x, y, vx, vy, c0, s0, b0, j0, k, cm, gap, fx0, fy0, along, across, line)
                ux, uy = vx + g * ax, vy + g * ay
                bx, by = _accelerate(
                    x + g * vx, y + g * vy, ux, uy, c1, s1, b1, j1, k, cm, gap, fx1, fy1, along, across, line
                )
                wx, wy = vx + g * bx, vy + g * by
                cx, cy = _accelerate(
                    x + g * ux, y + g * uy, wx, wy, c1, s1, b1, j1, k, cm, gap, fx1, fy1, along, across, line
                )
                zx, zy = vx + h * cx, vy + h * cy
                dx, dy = _accelerate(
                    x + h * wx, y + h * wy, zx, zy, c2, s2, b2, j2, k, cm, gap, fx2, fy2, along, across, line
                )
                sixth = h * (1.0 / 6.0)
                w[0, lane] = x + h * (vx + sixth * (ax + bx + cx))
                w[1, lane] = y + h * (vy + sixth * (ay + by + cy))
                w[2, lane] = vx + sixth * (ax + 2.0 * (bx + cx) + dx)
                w[3, lane] = vy + sixth * (ay + 2.0 * (by + cy) + dy)
                w[4, lane] = ay
                w[6, lane], w[7, lane], w[10, lane], w[11, lane] = c2, s2, d2, e2
            for lane in range(16):
                ring[place + step, lane] = w[4, lane]
        ready = i + 1 - blocks
        if ready >= 0:
            _filtered(ring, taps, ((i + 1) % blocks) * oversampling, output, ready)
    for lane in range(16):
        for row in range(4):
            state[row, lane] = w[row, lane]


@njit(parallel=True, cache=True)
def _integrate(state, turns, cage, rows, lengths, oversampling, taps, output, along, across, line):  # type: ignore[no-untyped-def]
    for group in prange(state.shape[0]):
        _run(
            state[group], turns[group], cage[group], rows[group], lengths[group], oversampling, taps, output[group],
            along, across, line,
        )  # fmt: skip


def integrate(
    n_rollers: int,
    state: Array,
    turns: Array,
    cage: Array,
    rows: Array,
    oversampling: int,
    taps: Array,
    output: Array,
    *,
    lengths: NDArray[np.int64] | None = None,
    point_contact: bool = True,
) -> None:
    """Integrate groups of sixteen trajectories; `numba.set_num_threads` says on how many cores.

    Parameters
    ----------
    n_rollers : int
        Compiled for each number once, then kept on disk.
    state : Array [groups, 4, 16]
        x, y (m), vx, vy (m/s); changed to the state at the end.
    turns, cage : Array [groups, intervals + 1, 16]
        Angle of shaft and cage at each output sample, turns; linear between.
    rows : Array [groups, len(ROWS), 16]
        Parameters, see `ROWS`.
    oversampling : int
        Internal steps per interval.
    taps : Array [blocks * oversampling]
        Low-pass: output i weighs the accelerations of intervals i to i + blocks - 1.
    output : Array [groups, intervals + 1 - blocks, 16]
        Filled with the acceleration in y, m/s^2.
    lengths : NDArray[int64] [groups], optional
        Intervals to integrate in each group; all of them when left out. What lies beyond stays as it was.
    point_contact : bool
        delta^1.5 (balls); False: delta^(10/9) (cylinders), slower by the power function.
    """
    along = tuple(math.cos(2 * math.pi * j / n_rollers) for j in range(n_rollers))
    across = tuple(math.sin(2 * math.pi * j / n_rollers) for j in range(n_rollers))
    if lengths is None:
        lengths = np.full(state.shape[0], turns.shape[1] - 1)
    line = None if point_contact else 10.0 / 9.0
    # numba's simplest threading layer ends the process when two Python threads enter at once.
    with _ONE_AT_A_TIME:
        _integrate(state, turns, cage, rows, lengths, oversampling, taps, output, along, across, line)
