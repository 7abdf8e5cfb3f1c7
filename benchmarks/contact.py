"""The contact twin's integrator against JAX, diffrax and SciPy, and its distance to what the machine can do."""

from __future__ import annotations

import math
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks import _contact_rivals as rivals
from benchmarks.harness import Measurement, Target, in_turn, ratio
from twingap.bearing import BEARINGS
from twingap.records import Condition
from twingap.twins.contact import PRESETS, ContactParameters
from twingap.twins.contact_dynamics import Job, low_pass
from twingap.twins.contact_integration import integrate
from twingap.twins.contact_kernel import (
    FLOPS_OF_A_ROLLER,
    FLOPS_OF_A_STEP,
    LANES,
    LOOK_AHEAD,
    LOOK_BACK,
    ROOTS_OF_A_ROLLER,
)

Array = NDArray[np.float64]

BEARING, SPEED_RPM, FS_HZ, FACTOR = BEARINGS["6205"], 1797.0, 12000.0, 10
DT = 1 / (FS_HZ * FACTOR)
ALWAYS_LOADED = replace(PRESETS["physical"], clearance_um=-15.0)
FACTORS = (4, 8, 16, 32, 64, 128)


def measure(quick: bool) -> Measurement:
    """Trajectory-steps per second of all rivals in turn; order of convergence; limits of the machine."""
    rounds = 3 if quick else 7
    own = PRESETS["physical"]
    rows, seconds, busy, work = _race(own, quick, rounds)
    rate = work[OURS] / statistics.median(seconds[OURS])
    peers = [name for name in seconds if name.startswith(("JAX", "diffrax"))]
    targets = [Target("trajectory-steps/s, all cores, median", rate, 2e7)]
    if peers:
        times = min(ratio(_per_step(seconds, work, peer), _per_step(seconds, work, OURS)) for peer in peers)
        targets.append(Target("times the faster of JAX and diffrax", times, 5.0))
    scipy = [name for name in seconds if name.startswith("SciPy")]
    times = min(ratio(_per_step(seconds, work, peer), _per_step(seconds, work, OURS)) for peer in scipy)
    targets.append(Target("times the fastest of SciPy's methods, at our accuracy within a factor of 2", times, 200.0))
    table, orders = _convergence(quick)
    targets.append(Target("order of convergence, smooth edge, all rollers loaded", orders[0], 3.8))
    targets.append(Target("order of convergence, smooth edge, with clearance, over errors above 1e-7", orders[1], 3.8))
    notes = [
        *table,
        *_limits(busy, work),
        "Everything ran in turn in the same rounds: on a shared machine the ratios mean more than the figures. The "
        "rivals give only their last state; ours decimates to one filtered acceleration per sample on the way.",
    ]
    if missing := rivals.absent("jax", "diffrax"):
        notes.append(f"Not installed and so not compared: {', '.join(missing)} (pip install 'twingap[bench]').")
    cores = numba.get_num_threads()
    return Measurement(
        f"{LANES * _groups(quick)} trajectories, 2 degrees of freedom, {BEARING.n_rollers} balls, outer-race fault, "
        f"float64, step {1e6 * DT:.2f} us, {cores} core{'s' * (cores > 1)} of {os.cpu_count()}",
        rows,
        targets,
        notes,
    )


OURS, ALONE = "twingap", "twingap, one core"


def _groups(quick: bool) -> int:
    return 2 * int(numba.get_num_threads()) * (1 if quick else 2)


def _race(
    own: ContactParameters, quick: bool, rounds: int
) -> tuple[list[dict[str, Any]], dict[str, list[float]], dict[str, list[float]], dict[str, float]]:
    """Rows of the table; seconds, CPU seconds and trajectory-steps per call (for the machine: roots and operations)."""
    groups, samples = _groups(quick), 400 if quick else 2000
    job = Job(BEARING, own, Condition("bench", SPEED_RPM, FS_HZ, 1, "outer"), np.zeros(1))
    calls: dict[str, Callable[[], object]] = {OURS: partial(_ours, own, groups, samples, FACTOR)}
    work = {OURS: float(groups * LANES * (samples + LOOK_BACK + LOOK_AHEAD) * FACTOR)}

    calls[ALONE] = partial(_on_one_core, partial(_ours, own, 1, 8 * samples, FACTOR))
    work[ALONE] = float(LANES * (8 * samples + LOOK_BACK + LOOK_AHEAD) * FACTOR)

    lanes, steps = (256, 400) if quick else (1024, 1000)
    starts = np.random.default_rng(0).random((lanes, 2))
    first = np.tile([job.equilibrium.x, job.equilibrium.y, 0.0, 0.0], (lanes, 1))
    for name, package, make in (
        ("JAX: RK4, jit, vmap", "jax", rivals.with_jax),
        ("diffrax: RK4, jit, vmap", "diffrax", rivals.with_diffrax),
    ):
        if not rivals.absent("jax", package):
            calls[name] = make(job, starts, first, DT, steps)
            work[name] = float(lanes * steps)

    for name, (call, steps_taken) in scipy_calls(own).items():
        calls[name], work[name] = call, steps_taken

    calls["peak"], work["peak"] = _multiply_and_add()
    calls["roots"], work["roots"] = _roots()
    busy: dict[str, list[float]] = {name: [] for name in calls}
    seconds = in_turn({name: partial(_timed, call, busy[name]) for name, call in calls.items()}, rounds)
    rows = [
        {
            "integrator": name,
            "trajectory-steps/s": f"{work[name] / statistics.median(taken):.3g}",
            "best round": f"{work[name] / min(taken):.3g}",
            "per CPU second": f"{work[name] / min(busy[name]):.3g}",
            "twingap is faster by": round(ratio(_per_step(seconds, work, name), _per_step(seconds, work, OURS)), 1),
        }
        for name, taken in seconds.items()
        if name not in ("peak", "roots")
    ]
    return rows, seconds, busy, work


def scipy_calls(own: ContactParameters) -> dict[str, tuple[Callable[[], object], float]]:
    """SciPy's methods at the loosest tolerance at which they are as accurate as we are, and our steps in their span.

    None of them gets a step limit, so as to be fast.
    """
    job = Job(BEARING, own, Condition("bench", SPEED_RPM, FS_HZ, 1, "outer"), np.zeros(1))
    first = np.array([job.equilibrium.x, job.equilibrium.y, 0.0, 0.0])
    begin = np.array([0.0, 0.24])
    span = 60 / FS_HZ
    truth = rivals.with_scipy(job, begin, first, span, "DOP853", 1e-12, 2e-6)
    error = float(np.abs(_last(own, begin, 60) - truth)[2:].max())
    calls: dict[str, tuple[Callable[[], object], float]] = {}
    for method in ("RK45", "LSODA"):
        for rtol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
            theirs = float(np.abs(rivals.with_scipy(job, begin, first, span, method, rtol) - truth)[2:].max())
            if theirs <= 2 * error:
                break
        call = partial(rivals.with_scipy, job, begin, first, span, method, rtol)
        calls[f"SciPy: solve_ivp {method}, rtol {rtol:g}"] = call, span / DT
    return calls


def _timed(call: Callable[[], object], busy: list[float]) -> None:
    """Call, and note the CPU seconds of all threads: what neighbours on a shared machine distort least."""
    begin = time.process_time()
    call()
    busy.append(time.process_time() - begin)


def _on_one_core(call: Callable[[], object]) -> None:
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        call()
    finally:
        numba.set_num_threads(threads)


def _per_step(seconds: dict[str, list[float]], work: dict[str, float], name: str) -> list[float]:
    return [s / work[name] for s in seconds[name]]


def _ours(own: ContactParameters, groups: int, samples: int, factor: int) -> Array:
    """What a batch of records costs, from states to decimated accelerations; returns the last states."""
    return prepared(own, groups, samples, factor)()


def prepared(
    own: ContactParameters, groups: int, samples: int, factor: int, device: str = "cpu"
) -> Callable[[], Array]:
    """A call that integrates from random angles."""
    points = samples + LOOK_BACK + LOOK_AHEAD + 1
    job = Job(BEARING, own, Condition("bench", SPEED_RPM, FS_HZ, points - 1, "outer"), np.zeros(1))
    random = np.random.default_rng(0).random((2, groups, 1, LANES))
    even = np.arange(points)[None, :, None] * (SPEED_RPM / 60 / FS_HZ)
    return partial(_go, job, groups, even + random[0], BEARING.ftf * even + random[1], factor, device)


def _last(own: ContactParameters, begin: Array, samples: int) -> Array:
    """State after so many samples of the trajectory that SciPy integrates."""
    job = Job(BEARING, own, Condition("bench", SPEED_RPM, FS_HZ, samples, "outer"), np.zeros(1))
    even = np.tile(np.arange(samples + 1)[None, :, None] * (SPEED_RPM / 60 / FS_HZ), (1, 1, LANES))
    return _go(job, 1, even + begin[0], BEARING.ftf * even + begin[1], FACTOR)[0, :, 0]


def _go(job: Job, groups: int, turns: Array, cage: Array, factor: int, device: str = "cpu") -> Array:
    state = np.zeros((groups, 4, LANES))
    state[:, 0], state[:, 1] = job.equilibrium.x, job.equilibrium.y
    rows = np.tile(np.array(job.rows(factor))[None, :, None], (groups, 1, LANES))
    output = np.empty((groups, max(turns.shape[1] - LOOK_BACK - LOOK_AHEAD, 0), LANES))
    point = job.parameters.contact == "point"
    integrate(
        BEARING.n_rollers, state, turns, cage, rows, *low_pass(factor), output, point_contact=point, device=device
    )  # fmt: skip
    return state


def _convergence(quick: bool) -> tuple[list[str], tuple[float, float]]:
    """A line per setting: RMS error of the velocities after a few passes, by internal steps per sample; and orders."""
    samples = 120 if quick else 360
    cases = {
        "smooth edge, all rollers loaded": ALWAYS_LOADED,
        "smooth edge, with clearance": PRESETS["physical"],
        "the papers' hard edge": replace(ALWAYS_LOADED, edge=0.0),
    }
    lines = [
        f"Velocity error by steps per sample at {FS_HZ:g} Hz: {', '.join(map(str, FACTORS))}; order by least squares."
    ]
    orders = []
    for name, own in cases.items():
        best = _ours(own, 1, samples, 2048)[:, 2:]
        errors = np.array([np.abs(_ours(own, 1, samples, factor)[:, 2:] - best) for factor in FACTORS])
        error = np.sqrt((errors**2).mean(axis=(1, 2, 3)) / (best**2).mean())
        kept = error > 1e-7
        order = -float(np.polyfit(np.log2(np.array(FACTORS)[kept]), np.log2(error[kept]), 1)[0])
        orders.append(order)
        lines.append(f"{name}: {', '.join(f'{e:.1e}' for e in error)}; order {order:.2f}")
    lines.append(
        "With clearance rollers leave and meet the race, where the law delta^1.5 is not smooth: below errors of some "
        "1e-7 that alone is left, and falls more slowly."
    )
    return lines, (orders[0], orders[1])


def _limits(busy: dict[str, list[float]], work: dict[str, float]) -> list[str]:
    """How far one core is from its arithmetic, in CPU seconds measured in the same rounds."""
    z = BEARING.n_rollers
    flops, roots = FLOPS_OF_A_STEP + FLOPS_OF_A_ROLLER * z, ROOTS_OF_A_ROLLER * z
    ours, peak, root_rate = (work[name] / min(busy[name]) for name in (ALONE, "peak", "roots"))
    by_flops, by_roots = peak / (flops + roots), root_rate / roots
    return [
        f"A trajectory-step is {flops} additions and multiplications and {roots} square roots. Arithmetic peak of a "
        f"core, measured here (fused multiply-adds in registers): {peak / 1e9:.1f} GFLOP/s, or {by_flops:.3g} "
        f"trajectory-steps/s; ours are {ours:.3g}, {100 * ours / by_flops:.0f} % of it.",
        f"The divider unit gives {root_rate / 1e9:.2f}e9 square roots/s a core here, or {by_roots:.3g} trajectory-"
        f"steps/s: the tightest limit of those measured; ours are {100 * ours / by_roots:.0f} % of it.",
    ]


def _multiply_and_add() -> tuple[Callable[[], object], float]:
    """Fused multiply-adds in registers, one core: its arithmetic peak."""

    def run(rounds: int) -> float:  # pragma: no cover
        own, a, b = np.full(64, 2.0), 0.999, 0.001
        for _ in range(rounds):
            for i in range(64):
                v = own[i]
                v = (((((((v * a + b) * a + b) * a + b) * a + b) * a + b) * a + b) * a + b) * a + b
                own[i] = (((((((v * a + b) * a + b) * a + b) * a + b) * a + b) * a + b) * a + b) * a + b
        return float(own[0])

    return partial(numba.njit(run, fastmath={"contract"}), 100_000), 2.0 * 16 * 64 * 100_000


def _roots() -> tuple[Callable[[], object], float]:
    """Vector square roots of numbers that lie in the first cache, one core."""

    def run(rounds: int) -> float:  # pragma: no cover
        own = np.full(1024, 2.0)
        for _ in range(rounds):
            for i in range(own.size):
                own[i] = math.sqrt(own[i])
        return float(own[0])

    return partial(numba.njit(run), 40_000), 1024.0 * 40_000
