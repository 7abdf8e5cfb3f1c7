"""Machines simulated on a dask cluster of two workers on this machine, against one worker and against this process."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.harness import Measurement, Target
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.provenance import digest_of_value
from twingap.records import Condition
from twingap.sweep import sweep
from twingap.sweep.cluster import distributed
from twingap.twins.phenomenological import PhenomenologicalTwin

FS_HZ, SAMPLES = 12000.0, 12000
EFFECTS = ("speed_fluctuation", "distributed_roughness", "sensor_rolloff", "coloured_noise", "dropout")
EFFICIENCY = 0.85


@dataclass(frozen=True)
class Machine:
    """Records of one simulated machine."""

    seed: int
    records: int


def spectra(job: Machine) -> dict[str, object]:
    """Mean spectra of a machine's records, one for each fault."""
    rng = np.random.default_rng(job.seed)
    twin = PhenomenologicalTwin(BEARINGS["6205"], effects=[make_effect(name) for name in EFFECTS])
    faults = ("healthy", "inner", "outer", "ball")
    conditions = [
        Condition(f"{i}", float(rng.uniform(900, 2400)), FS_HZ, SAMPLES, faults[i % 4]) for i in range(job.records)
    ]
    total = {fault: np.zeros(SAMPLES // 2 + 1) for fault in faults}
    for record in twin.stream(conditions, rng, threads=1):
        total[str(record.condition.fault)] += np.abs(np.fft.rfft(record.samples))
    return {fault: sums / job.records for fault, sums in total.items()}


def measure(quick: bool) -> Measurement:
    """Seconds for 50 machines (4 small ones when quick), the workers already started."""
    machines = [Machine(seed, 8 if quick else 400) for seed in range(4 if quick else 50)]
    seconds, results = {}, {}
    for workers in (1, 2):
        with distributed().LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as local:
            warm = [Machine(1000 + i, 8) for i in range(4 * workers)]
            sweep(spectra, warm, backend="dask", address=local.scheduler_address)
            seconds[workers], results[workers] = _timed(machines, "dask", local.scheduler_address)
    few = machines[: 2 if quick else 5]
    alone, local_results = _timed(few, "sequential", None)
    alone *= len(machines) / len(few)
    rows = [
        {
            "run": name,
            "s": f"{s:.1f}",
            "machines/s": f"{len(machines) / s:.2f}",
            "of ideal": f"{seconds[1] / s / n:.0%}",
        }
        for name, s, n in (
            (f"this process, from {len(few)} machines", alone, 1),
            ("one worker", seconds[1], 1),
            ("two workers", seconds[2], 2),
        )
    ]
    same = results[1] == results[2] and results[1][: len(few)] == local_results
    targets = [
        Target("throughput of two workers over twice that of one", seconds[1] / seconds[2] / 2, EFFICIENCY),
        Target("same bytes on one worker, on two and in this process (1 = yes)", float(same), 1.0),
    ]
    notes = ["Two workers need two idle cores: other programs on the machine lower the first figure."]
    return Measurement(f"{len(machines)} machines of {machines[0].records} records each", rows, targets, notes)


def _timed(machines: Sequence[Machine], backend: str, address: str | None) -> tuple[float, list[str]]:
    """Seconds of a sweep that stores its results, and their digests."""
    with TemporaryDirectory() as folder:
        begin = time.perf_counter()
        made = sweep(spectra, machines, store=Path(folder), backend=backend, address=address)
        seconds = time.perf_counter() - begin
    return seconds, [digest_of_value({k: v.tobytes().hex() for k, v in result.value.items()}) for result in made]
