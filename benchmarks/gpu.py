"""The contact twin on a GPU against all cores of this machine, and its integrator against diffrax and JAX there.

Transfers to and from the GPU count. Of whole records, random numbers, effects and noise stay on the CPU.
"""

from __future__ import annotations

import os
import statistics
from collections.abc import Callable
from functools import partial
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks import _contact_rivals as rivals
from benchmarks.contact import BEARING, DT, FACTOR, FS_HZ, SPEED_RPM, prepared
from benchmarks.harness import Measurement, Target, in_turn, ratio
from twingap.records import Condition
from twingap.twins import gpu
from twingap.twins.base import GPU_SAMPLES
from twingap.twins.contact import PRESETS, ContactTwin
from twingap.twins.contact_dynamics import Job
from twingap.twins.contact_kernel import LANES, LOOK_AHEAD, LOOK_BACK

AGREEMENT = 1e-8
"""Largest difference of a record's samples, in its RMS, that rounding may make."""

CPU, GPU = "twingap, all cores", "twingap, GPU"


def measure(quick: bool) -> Measurement:
    """Integrator and whole records of the contact twin, on the CPU and on the GPU in turn."""
    gpu.check("benchmark gpu")
    rounds, notes = 2 if quick else 3, list[str]()
    lanes, samples = (64, 40) if quick else (16384, 2000)
    few = min(lanes, 8 * LANES * numba.get_num_threads())  # a CPU takes as long for each of many
    own, intervals = PRESETS["physical"], samples + LOOK_BACK + LOOK_AHEAD
    work = {CPU: few * intervals * FACTOR, GPU: lanes * intervals * FACTOR}
    calls: dict[str, Callable[[], object]] = {
        CPU: prepared(own, few // LANES, samples, FACTOR),
        GPU: prepared(own, lanes // LANES, samples, FACTOR, "cuda"),
    }
    job = Job(BEARING, own, Condition("bench", SPEED_RPM, FS_HZ, 1, "outer"), np.zeros(1))
    starts = np.random.default_rng(0).random((lanes, 2))
    first = np.tile([job.equilibrium.x, job.equilibrium.y, 0.0, 0.0], (lanes, 1))
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    for package, make in (("diffrax", rivals.with_diffrax), ("jax", rivals.with_jax)):
        name = f"{package}, GPU"
        try:
            calls[name], work[name] = make(job, starts, first, DT, samples, "gpu"), lanes * samples
        except (ImportError, RuntimeError) as error:  # not installed, or without a GPU
            notes.append(f"{package}: not compared, {' '.join(str(error).split())[:200]}")
    rows = _rows("integrator", "trajectory-steps", work, in_turn(calls, rounds))
    count, length = (64, 600) if quick else (GPU_SAMPLES // round(FS_HZ), round(FS_HZ))
    faults = ("healthy", "inner", "outer", "ball")
    conditions = [Condition(f"{i}", SPEED_RPM, FS_HZ, length, faults[i % 4]) for i in range(count)]
    made: dict[str, list[NDArray[np.float64]]] = {}

    def records(device: str) -> None:
        stream = ContactTwin(BEARING).on(device).stream(conditions, np.random.default_rng(0))
        made[device] = [record.samples for record in stream]

    calls = {CPU: partial(records, "cpu"), GPU: partial(records, "cuda")}
    rows += _rows("records", "records", dict.fromkeys(calls, count), in_turn(calls, rounds))
    apart = max(float(np.abs(a - b).max() / a.std()) for a, b in zip(made["cpu"], made["cuda"], strict=True))
    name = f"records: {AGREEMENT:g} of their RMS over the largest difference from the CPU's"
    cores = numba.get_num_threads()
    title = f"{lanes} trajectories; {count} records of {length} samples; CPU: {cores} core{'s' * (cores > 1)}"
    return Measurement(title, rows, [Target(name, AGREEMENT / max(apart, 1e-16), 1.0)], notes)


def _rows(what: str, unit: str, work: dict[str, int], seconds: dict[str, list[float]]) -> list[dict[str, Any]]:
    per_item = {name: [s / work[name] for s in taken] for name, taken in seconds.items()}
    return [
        {
            "what": f"{what}: {name}",
            "per second": f"{1 / statistics.median(taken):.3g} {unit}",
            "times the CPU's": round(ratio(per_item[CPU], taken), 2),
        }
        for name, taken in per_item.items()
    ]
