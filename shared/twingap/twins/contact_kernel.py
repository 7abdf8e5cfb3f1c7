"""Integration of the contact model: fixed-step RK4, sixteen trajectories to a group, one group to a thread.

state, turns [groups, intervals + 1, 16] --> RK4, many steps per interval --> low-pass, two values per interval
                                                       --> low-pass, one --> accelerations [groups, samples, 16]

What makes it fast, and the same to the bit whatever the number of threads and whoever shares the group:

- Sixteen trajectories go through the same instructions, so that the compiler puts them into the lanes of its vector
  registers. The number of rollers is a constant of the compiled code: the loop over rollers is unrolled, and a step
  keeps everything in registers. Lanes never mix, and no fast-math is allowed.
- The contact is solved in the cage's frame, where the rollers stand still: a roller costs two products to project the
  displacement and two to add its force, and no sine or cosine. The cage's own sine and cosine turn by a recurrence
  that is anchored again at every output sample.
- Rollers are evenly spaced, so at most one of them is inside a defect that is narrower than a pitch: the depth is found
  once per evaluation, then given to the roller whose turn it is.

What costs most then is the square root in delta^1.5 = delta sqrt(delta), which bounds the speed from above (see
`benchmarks/contact.py`).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from twingap import _compiled

Array = NDArray[np.float64]

LANES: Final = 16
"""Trajectories in a group: two AVX-512 or four AVX2 registers of doubles, enough to hide latencies."""

LOOK_BACK: Final = 18
LOOK_AHEAD: Final = 17
"""Intervals before and after a sample that the two low-pass filters need."""

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

ROOTS_OF_A_ROLLER: Final = 4
"""Square roots per step: one in each of the four evaluations."""

FLOPS_OF_A_ROLLER: Final = 4 * (5 + 1 + 4)
"""Additions and multiplications per step: squeeze, delta sqrt(delta), force. Comparisons and choices not counted."""

FLOPS_OF_A_STEP: Final = 4 * 20 + 24 + 12 + 3 * 20 + 24 + 24 + 3 + 12
"""The rest: evaluations (rotations, equations of motion), turning cage and shaft, unbalance, defect, stages and
their sums, constants, first low-pass."""


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


@njit(inline="always")
def _interval(t, dt, c, dc, part, g, eccentric, per_turn, per_cage, passed, z):  # type: ignore[no-untyped-def]
    # At a sample: cage, its turn in half a step, shaft, its turn (cos and sin each); unbalance; phase and its step.
    speed = dt * part / (2.0 * g)
    p = per_turn * t + per_cage * c + passed
    c0, s0 = _turn(c - math.floor(c))
    rc, rs = _turn(0.5 * part * dc)
    d0, e0 = _turn(t - math.floor(t))
    qc, qs = _turn(0.5 * part * dt)
    # Whole rounds of all rollers change nothing, but would cost digits late in a long record.
    p -= z * math.floor(p / z)
    return c0, s0, rc, rs, d0, e0, qc, qs, eccentric * speed * speed, p, per_turn * dt + per_cage * dc


@njit(inline="always")
def _step(x, y, vx, vy, c0, s0, rc, rs, d0, e0, qc, qs, unbalance, p, dp, u0, u1, u2, own, along, across, line, z):  # type: ignore[no-untyped-def] # fmt: skip
    # State, cage and shaft after a step, and the acceleration in y before it. u0, u1, u2: parts of the interval.
    g, k, cm, gap, fx, fy, deep, steep, narrow, moves = own
    h = 2.0 * g
    c1, s1 = c0 * rc - s0 * rs, s0 * rc + c0 * rs
    c2, s2 = c1 * rc - s1 * rs, s1 * rc + c1 * rs
    d1, e1 = d0 * qc - e0 * qs, e0 * qc + d0 * qs
    d2, e2 = d1 * qc - e1 * qs, e1 * qc + d1 * qs
    b0, j0 = _defect(p + dp * u0, deep, steep, narrow, moves, z)
    b1, j1 = _defect(p + dp * u1, deep, steep, narrow, moves, z)
    b2, j2 = _defect(p + dp * u2, deep, steep, narrow, moves, z)
    px, py = fx + unbalance * d0, fy + unbalance * e0
    qx, qy = fx + unbalance * d1, fy + unbalance * e1
    rx, ry = fx + unbalance * d2, fy + unbalance * e2
    # Classical RK4 for x'' = a: the stages' velocities are (vx, vy), (ux, uy), (wx, wy), (zx, zy).
    ax, ay = _accelerate(x, y, vx, vy, c0, s0, b0, j0, k, cm, gap, px, py, along, across, line)
    ux, uy = vx + g * ax, vy + g * ay
    x1, y1 = x + g * vx, y + g * vy
    bx, by = _accelerate(x1, y1, ux, uy, c1, s1, b1, j1, k, cm, gap, qx, qy, along, across, line)
    wx, wy = vx + g * bx, vy + g * by
    x2, y2 = x + g * ux, y + g * uy
    cx, cy = _accelerate(x2, y2, wx, wy, c1, s1, b1, j1, k, cm, gap, qx, qy, along, across, line)
    zx, zy = vx + h * cx, vy + h * cy
    x3, y3 = x + h * wx, y + h * wy
    dx, dy = _accelerate(x3, y3, zx, zy, c2, s2, b2, j2, k, cm, gap, rx, ry, along, across, line)
    sixth = h * (1.0 / 6.0)
    x, y = x + h * (vx + sixth * (ax + bx + cx)), y + h * (vy + sixth * (ay + by + cy))
    vx, vy = vx + sixth * (ax + 2.0 * (bx + cx) + dx), vy + sixth * (ay + 2.0 * (by + cy) + dy)
    return x, y, vx, vy, c2, s2, d2, e2, ay


@njit
def _weighed(ring, taps, oldest, output, ready):  # type: ignore[no-untyped-def]
    sums = np.zeros(16)
    for tap in range(taps.shape[0]):
        at = 16 * (oldest + tap)
        for lane in range(16):
            sums[lane] += taps[tap] * ring[at + lane]
    for lane in range(16):
        output[ready, lane] = sums[lane]


@njit
def _run(state, turns, cage, rows, intervals, first, second, output, along, across, line):  # type: ignore[no-untyped-def]
    z = float(len(along))
    steps = first.shape[1]
    part = 0.5 / steps
    # Half-sample values, each kept twice and a ring's length apart, so that the filter finds its window in one piece.
    size = second.shape[0]
    ring = np.zeros(2 * size * 16)
    # One workspace whose shape the compiler knows: it then sees that rows never overlap, and fills whole vectors.
    # 0-3 state; 4 spare; 5-8 cage, 9-12 shaft (angle, half-step turn); 13 unbalance; 14, 15 phase and its step over the
    # interval; 16, 17 spare; 18-31 the parameters; 32-37 the first low-pass, one unfinished half sample each.
    w = np.zeros((38, 16))
    for lane in range(16):
        for row in range(4):
            w[row, lane] = state[row, lane]
        for row in range(14):
            w[18 + row, lane] = rows[row, lane]
    for i in range(intervals):
        for lane in range(16):
            w[14, lane] = turns[i, lane]
            w[15, lane] = turns[i + 1, lane] - w[14, lane]
            w[16, lane] = cage[i, lane]
            w[17, lane] = cage[i + 1, lane] - w[16, lane]
        for lane in range(16):
            (
                w[5, lane], w[6, lane], w[7, lane], w[8, lane], w[9, lane], w[10, lane], w[11, lane], w[12, lane],
                w[13, lane], w[14, lane], w[15, lane],
            ) = _interval(
                w[14, lane], w[15, lane], w[16, lane], w[17, lane], part, w[18, lane], w[24, lane], w[28, lane],
                w[29, lane], w[30, lane], z,
            )  # fmt: skip
        for half in range(2):
            for step in range(steps):
                inside = half * steps + step
                u0, u1, u2 = inside * part, (inside + 0.5) * part, (inside + 1) * part
                f0, f1, f2 = first[0, step], first[1, step], first[2, step]
                f3, f4, f5 = first[3, step], first[4, step], first[5, step]
                for lane in range(16):
                    x, y, vx, vy, c, s, d, e, ay = _step(
                        w[0, lane], w[1, lane], w[2, lane], w[3, lane], w[5, lane], w[6, lane], w[7, lane], w[8, lane],
                        w[9, lane], w[10, lane], w[11, lane], w[12, lane], w[13, lane], w[14, lane], w[15, lane],
                        u0, u1, u2,
                        (
                            w[18, lane], w[19, lane], w[20, lane], w[21, lane], w[22, lane], w[23, lane], w[25, lane],
                            w[26, lane], w[27, lane], w[31, lane],
                        ),
                        along, across, line, z,
                    )  # fmt: skip
                    w[0, lane], w[1, lane], w[2, lane], w[3, lane] = x, y, vx, vy
                    w[5, lane], w[6, lane], w[9, lane], w[10, lane] = c, s, d, e
                    w[32, lane] += f0 * ay
                    w[33, lane] += f1 * ay
                    w[34, lane] += f2 * ay
                    w[35, lane] += f3 * ay
                    w[36, lane] += f4 * ay
                    w[37, lane] += f5 * ay
            place = (2 * i + half) % size
            for lane in range(16):
                w[4, lane] = w[32, lane]
                w[32, lane], w[33, lane], w[34, lane] = w[33, lane], w[34, lane], w[35, lane]
                w[35, lane], w[36, lane], w[37, lane] = w[36, lane], w[37, lane], 0.0
            for lane in range(16):
                ring[16 * place + lane] = w[4, lane]
                ring[16 * (place + size) + lane] = w[4, lane]
        ready = i - (LOOK_BACK + LOOK_AHEAD - 1)
        if ready >= 0:
            _weighed(ring, second, (2 * i + 2) % size, output, ready)
    for lane in range(16):
        for row in range(4):
            state[row, lane] = w[row, lane]


@_compiled.njit(parallel=True, nogil=False, no_cfunc_wrapper=False, error_model="python")
def integrate_groups(state, turns, cage, rows, lengths, first, second, output, along, across, line):  # type: ignore[no-untyped-def]
    for group in prange(state.shape[0]):
        _run(
            state[group], turns[group], cage[group], rows[group], lengths[group], first, second, output[group],
            along, across, line,
        )  # fmt: skip
