"""Integration of the contact model on the processor or a GPU, by the compiled code of `contact_kernel` or `gpu`."""

from __future__ import annotations

import math
import threading

import numpy as np
from numba import get_num_threads, set_num_threads
from numpy.typing import NDArray

from twingap.twins.contact_kernel import integrate_groups

Array = NDArray[np.float64]

_ONE_AT_A_TIME = threading.Lock()


def integrate(
    n_rollers: int,
    state: Array,
    turns: Array,
    cage: Array,
    rows: Array,
    first: Array,
    second: Array,
    output: Array,
    *,
    lengths: NDArray[np.int64] | None = None,
    point_contact: bool = True,
    device: str = "cpu",
) -> None:
    """Integrate groups of sixteen trajectories; `numba.set_num_threads` sets the number of cores.

    Parameters
    ----------
    n_rollers : int
        Compiled for each number once, then kept on disk.
    state : Array [groups, 4, 16]
        x, y (m), vx, vy (m/s); changed to the state at the end.
    turns, cage : Array [groups, intervals + 1, 16]
        Angle of shaft and cage at each output sample, turns; linear between.
    rows : Array [groups, len(ROWS), 16]
        Parameters, see `contact_kernel.ROWS`.
    first : Array [6, steps]
        Low-pass from the internal rate to two values per sample, `steps` internal steps apart: the value between two
        half samples weighs the accelerations of three before (rows 5, 4, 3) and three after it (rows 2, 1, 0).
    second : Array [2 * 32]
        Low-pass from there to the record's rate, over 32 half samples before and after a sample.
    output : Array [groups, intervals + 1 - LOOK_BACK - LOOK_AHEAD, 16]
        Filled with the acceleration in y, m/s^2, at sample LOOK_BACK and those after it.
    lengths : NDArray[int64] [groups], optional
        Intervals to integrate in each group; all of them when left out. What lies beyond stays as it was, or is
        undefined on a GPU.
    point_contact : bool
        delta^1.5 (balls); False: delta^(10/9) (cylinders), slower by the power function.
    device : {"cpu", "cuda"}
        "cuda": on a GPU, the same within rounding (`twins.gpu`).
    """
    along = tuple(math.cos(2 * math.pi * j / n_rollers) for j in range(n_rollers))
    across = tuple(math.sin(2 * math.pi * j / n_rollers) for j in range(n_rollers))
    if lengths is None:
        lengths = np.full(state.shape[0], turns.shape[1] - 1)
    line = None if point_contact else 10.0 / 9.0
    if device == "cuda":
        from twingap.twins import gpu

        gpu.integrate(state, turns, cage, rows, lengths, first, second, output, along, across, line)
        return
    threads = get_num_threads()
    # numba's simplest threading layer ends the process when two Python threads enter at once.
    with _ONE_AT_A_TIME:
        set_num_threads(
            min(threads, max(state.shape[0], 1))
        )  # waking a thread that gets no group costs more than it runs
        try:
            integrate_groups(state, turns, cage, rows, lengths, first, second, output, along, across, line)
        finally:
            set_num_threads(threads)
