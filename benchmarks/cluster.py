"""Machines simulated on a dask cluster of two workers on this machine, against two plain processes and one worker.

The plain processes do the same work with nothing to coordinate: what two workers can reach on this machine, whatever
its cores share and whatever else runs on it. Processor time tells more where other programs run beside them.
"""

from __future__ import annotations

import multiprocessing
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.harness import Measurement, Target, in_turn, ratio
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.provenance import digest_of_value
from twingap.records import Condition
from twingap.sweep import sweep
from twingap.sweep.cluster import local_cluster
from twingap.twins.phenomenological import PhenomenologicalTwin

FS_HZ, SAMPLES = 51200.0, 51200
EFFECTS = ("speed_fluctuation", "distributed_roughness", "sensor_rolloff", "coloured_noise", "dropout")
EFFICIENCY = 0.85
CPU = "processor time"
WORKERS = (1, 2)


@dataclass(frozen=True)
class Machine:
    """Records of one simulated machine."""

    seed: int
    records: int


def spectra(job: Machine) -> dict[str, object]:
    """Mean spectra of a machine's records, one for each fault, and the processor time that they took, s."""
    begin = time.process_time()
    rng = np.random.default_rng(job.seed)
    twin = PhenomenologicalTwin(BEARINGS["6205"], effects=[make_effect(name) for name in EFFECTS])
    faults = ("healthy", "inner", "outer", "ball")
    conditions = [
        Condition(f"{i}", float(rng.uniform(900, 2400)), FS_HZ, SAMPLES, faults[i % 4]) for i in range(job.records)
    ]
    total = {fault: np.zeros(SAMPLES // 2 + 1) for fault in faults}
    for record in twin.stream(conditions, rng, threads=1):
        total[str(record.condition.fault)] += np.abs(np.fft.rfft(record.samples))
    return {fault: sums / job.records for fault, sums in total.items()} | {CPU: time.process_time() - begin}


def measure(quick: bool) -> Measurement:
    """Seconds for 50 machines (4 small ones when quick), in turn, workers and processes already started."""
    machines = [Machine(seed, 8 if quick else 20) for seed in range(4 if quick else 50)]
    results: dict[str, list[str]] = {}
    cpu: dict[str, list[float]] = {}
    with ExitStack() as stack:
        calls: dict[str, Callable[[], object]] = {}
        for n in WORKERS:
            # Unlike multiprocessing.Pool, it ends also after one of its processes was killed.
            pool = stack.enter_context(ProcessPoolExecutor(n, multiprocessing.get_context("spawn")))
            list(pool.map(time.sleep, [0.1] * n))  # started before dask changes the environment
            calls[f"processes {n}"] = partial(_on_processes, machines, pool.map, f"processes {n}", results, cpu)
        for n in WORKERS:
            address = stack.enter_context(local_cluster(n))
            calls[f"cluster {n}"] = partial(_on_cluster, machines, address, f"cluster {n}", results, cpu)
        seconds = in_turn(calls, 1 if quick else 3)
    names = {
        "processes 1": "one plain process",
        "processes 2": "two plain processes",
        "cluster 1": "one worker",
        "cluster 2": "two workers",
    }
    rows = [
        {
            "run": name,
            "machines/s": f"{len(machines) / statistics.median(seconds[key]):.2f}",
            "CPU s a machine": f"{statistics.median(cpu[key]) / len(machines):.3f}",
            "of as many plain processes": f"{ratio(seconds[f'processes {key[-1]}'], seconds[key]):.0%}",
            "of one times their number": f"{ratio(seconds[f'{key[:-2]} 1'], seconds[key]) / int(key[-1]):.0%}",
        }
        for key, name in names.items()
    ]
    same = len({tuple(digests) for digests in results.values()}) == 1
    targets = [
        Target("throughput of two workers over that of two plain processes",
               ratio(seconds["processes 2"], seconds["cluster 2"]), EFFICIENCY),
        Target("processor time of two plain processes over that of two workers",
               ratio(cpu["processes 2"], cpu["cluster 2"]), EFFICIENCY),
        Target("same bytes on one worker, on two and in plain processes (1 = yes)", float(same), 1.0),
    ]  # fmt: skip
    notes = [
        "Cores that share a unit, and other programs, slow two plain processes as much as two workers: the last column "
        "tells the machine, the one before it the cluster. Workers also send and store what they have computed."
    ]
    return Measurement(f"{len(machines)} machines of {machines[0].records} records each", rows, targets, notes)


def _on_cluster(
    machines: Sequence[Machine], address: str, name: str, results: dict[str, list[str]], cpu: dict[str, list[float]]
) -> None:
    """A sweep on a running cluster that stores its results."""
    with TemporaryDirectory() as folder:
        made = sweep(spectra, machines, store=Path(folder), backend="dask", address=address)
    _note(name, [result.value for result in made], results, cpu)


def _on_processes(
    machines: Sequence[Machine], each: Callable[..., Iterable[dict[str, Any]]], name: str,
    results: dict[str, list[str]], cpu: dict[str, list[float]],
) -> None:  # fmt: skip
    """The same work, and nothing stored."""
    _note(name, list(each(spectra, machines)), results, cpu)


def _note(
    name: str, values: Sequence[dict[str, Any]], results: dict[str, list[str]], cpu: dict[str, list[float]]
) -> None:
    """Keep processor time and digests of a run."""
    cpu.setdefault(name, []).append(sum(value.pop(CPU) for value in values))
    results[name] = [_digest(value) for value in values]


def _digest(value: dict[str, object]) -> str:
    return digest_of_value({k: np.asarray(v).tobytes().hex() for k, v in value.items()})
