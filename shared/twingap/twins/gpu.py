"""Integration of the contact model on an NVIDIA GPU: one trajectory to a thread.

A thread computes what a lane of `contact_kernel` computes, with the same functions and in double precision. Results
differ by rounding alone: the GPU's compiler fuses multiplications with additions. A time step is a chain of dependent
operations, which no GPU does faster than a processor; what it gains is the number of chains at once.

The kernel is compiled in each process. ``NUMBA_ENABLE_CUDASIM=1`` runs it in numba's simulator, where there is no GPU.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, Final

import numpy as np
from numba import cuda
from numba.core.errors import NumbaPerformanceWarning
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.twins import contact_kernel as kernel

Array = NDArray[np.float64]

BLOCK: Final = 32
"""Threads of a block: a single warp, so that few records still spread over all multiprocessors."""

TAPS: Final = 64
"""Half samples that the second low-pass weighs."""


def check(where: str) -> None:
    """Raise `TwingapError` without an NVIDIA GPU, its driver, or CUDA's compiler."""
    with _in_a_line(where):
        if not cuda.is_available():
            mend = "it takes an NVIDIA GPU and pip install 'twingap[gpu]'"
            raise TwingapError("there is no GPU that CUDA can use", where=where, mend=mend)


def integrate(
    state: Array,
    turns: Array,
    cage: Array,
    rows: Array,
    lengths: NDArray[np.int64],
    first: Array,
    second: Array,
    output: Array,
    along: tuple[float, ...],
    across: tuple[float, ...],
    line: float | None,
) -> None:
    """Integrate groups of sixteen trajectories; parameters of `contact_kernel.integrate_groups`.

    What lies in `output` beyond a group's length is undefined.

    Raises
    ------
    TwingapError
        Where the GPU fails, as by lack of memory.
    """
    threads = state.shape[0] * kernel.LANES
    with _in_a_line("device 'cuda'"), warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaPerformanceWarning)  # few records are the user's choice
        own, *others = (cuda.to_device(each) for each in (state, turns, cage, rows, lengths, first, second))
        made = cuda.device_array(output.shape, np.float64)
        _compiled(along, across, line)[-(-threads // BLOCK), BLOCK](own, *others, made)
        own.copy_to_host(state)
        made.copy_to_host(output)


@contextmanager
def _in_a_line(where: str) -> Iterator[None]:
    """What numba and the driver raise as a `TwingapError`: their types differ between versions."""
    try:
        yield
    except TwingapError:
        raise
    except Exception as error:
        what = f"the GPU cannot be used: {type(error).__name__}: {error}"
        raise TwingapError(what, where=where, mend="leave the device out") from error


@cache
def _compiled(along: tuple[float, ...], across: tuple[float, ...], line: float | None) -> Any:
    """`contact_kernel._run` for the trajectory of one thread, and a number of rollers that the compiler knows."""
    interval, step = kernel._interval, kernel._step
    reach = kernel.LOOK_BACK + kernel.LOOK_AHEAD - 1
    z = float(len(along))
    # Arrays of a known length, by which the compiler unrolls the loop over rollers; of tuples it makes branches.
    cosines, sines = np.array(along), np.array(across)

    @cuda.jit
    def contact(state, turns, cage, rows, lengths, first, second, output):  # type: ignore[no-untyped-def]  # pragma: no cover
        at = cuda.grid(1)
        group, lane = at // 16, at % 16
        if group >= state.shape[0]:
            return
        cosine, sine = cuda.const.array_like(cosines), cuda.const.array_like(sines)
        steps = first.shape[1]
        part = 0.5 / steps
        ring = cuda.local.array(TAPS, np.float64)
        for tap in range(TAPS):
            ring[tap] = 0.0
        x, y, vx, vy = state[group, 0, lane], state[group, 1, lane], state[group, 2, lane], state[group, 3, lane]
        g, k, cm = rows[group, 0, lane], rows[group, 1, lane], rows[group, 2, lane]
        gap, fx, fy = rows[group, 3, lane], rows[group, 4, lane], rows[group, 5, lane]
        eccentric, deep, steep = rows[group, 6, lane], rows[group, 7, lane], rows[group, 8, lane]
        narrow, per_turn, per_cage = rows[group, 9, lane], rows[group, 10, lane], rows[group, 11, lane]
        passed, moves = rows[group, 12, lane], rows[group, 13, lane]
        own = (g, k, cm, gap, fx, fy, deep, steep, narrow, moves)
        sum0, sum1, sum2, sum3, sum4, sum5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(lengths[group]):
            t, c = turns[group, i, lane], cage[group, i, lane]
            dt, dc = turns[group, i + 1, lane] - t, cage[group, i + 1, lane] - c
            c0, s0, rc, rs, d0, e0, qc, qs, unbalance, p, dp = interval(
                t, dt, c, dc, part, g, eccentric, per_turn, per_cage, passed, z
            )
            for half in range(2):
                for j in range(steps):
                    inside = half * steps + j
                    x, y, vx, vy, c0, s0, d0, e0, ay = step(
                        x, y, vx, vy, c0, s0, rc, rs, d0, e0, qc, qs, unbalance, p, dp,
                        inside * part, (inside + 0.5) * part, (inside + 1) * part, own, cosine, sine, line, z,
                    )  # fmt: skip
                    sum0 += first[0, j] * ay
                    sum1 += first[1, j] * ay
                    sum2 += first[2, j] * ay
                    sum3 += first[3, j] * ay
                    sum4 += first[4, j] * ay
                    sum5 += first[5, j] * ay
                ring[(2 * i + half) % TAPS] = sum0
                sum0, sum1, sum2, sum3, sum4, sum5 = sum1, sum2, sum3, sum4, sum5, 0.0
            if i >= reach:
                filtered = 0.0
                for tap in range(TAPS):
                    filtered += second[tap] * ring[(2 * i + 2 + tap) % TAPS]
                output[group, i - reach, lane] = filtered
        state[group, 0, lane], state[group, 1, lane] = x, y
        state[group, 2, lane], state[group, 3, lane] = vx, vy

    return contact
