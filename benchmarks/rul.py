"""An online update of remaining life against a row of a particle filter, and what a long run takes and holds."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.harness import Measurement, Target
from papers.extra.femto.rivals import Growth, particle_filter
from twingap.prognosis.estimate import LifeOptions
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.simulated_runs import SimulatedRun, simulate_run
from twingap.records import Condition, Record
from twingap.records.folder import write_records

MOST_S, MOST_MB = 1.0, 1000.0
ROWS = 3000
SAMPLES = 2560
"""Of a record, as FEMTO's have."""


def measure(quick: bool, seed: int = 0) -> Measurement:
    """Time of every update of a long run, of the filter's rows, and the command on records of such a run."""
    rows = 300 if quick else ROWS
    run = simulate_run(np.random.default_rng(seed), "exponential", rows=rows, varying=True)
    life, spent = OnlineLife(LifeOptions(limit_ratio=run.limit_ratio)), []
    for row in zip(run.time_s, run.speed_rpm, run.peak_to_peak, strict=True):
        begin = time.perf_counter()
        life.update(*(float(v) for v in row))
        spent.append(time.perf_counter() - begin)
    assert life.alarm_row is not None
    after = spent[life.alarm_row :]
    _, turns, logs = life.amplitudes
    growth = Growth(turns - turns[0], logs, life.scatter, 0, life.end_level, float(turns[-1] - turns[0]))
    begin = time.perf_counter()
    particle_filter(growth, np.random.default_rng(seed))
    filtered = (time.perf_counter() - begin) / turns.size
    seconds, megabytes = _command(run, seed)
    table = [
        {"what": "twingap rul, an update after the alarm", "rows": len(after),
         "median": f"{1e3 * statistics.median(after):.2f} ms", "most": f"{1e3 * max(after):.2f} ms"},
        {"what": "particle filter, 1000 particles, a row", "rows": turns.size, "median": f"{1e3 * filtered:.2f} ms",
         "most": ""},
        {"what": f"the command, records of {SAMPLES} samples", "rows": run.time_s.size, "median": f"{seconds:.1f} s",
         "most": f"{megabytes:.0f} MB"},
    ]  # fmt: skip
    return Measurement(
        f"remaining life online, a run of {run.time_s.size} rows at varying speed",
        table,
        [
            Target(f"{MOST_S:g} s over the costliest update", MOST_S / max(spent), 1.0),
            Target(f"{MOST_MB:g} MB over what the command holds at most", MOST_MB / megabytes, 1.0),
        ],
        [
            "An update weighs its laws of growth anew by all that was seen, in a bounded number of bins; the filter "
            "knows one law and moves on from its last row."
        ],
    )


def _command(run: SimulatedRun, seed: int) -> tuple[float, float]:
    """Seconds and greatest resident memory, MB, of `twingap rul` on such a run's records."""
    rng = np.random.default_rng(seed)

    def records() -> Iterator[Record]:
        for row, (time_s, speed, height) in enumerate(zip(run.time_s, run.speed_rpm, run.peak_to_peak, strict=True)):
            x = rng.standard_normal(SAMPLES)
            condition = Condition(f"{row}", float(speed), 25600.0, SAMPLES, time_s=float(time_s), group="run")
            yield Record(condition, x * float(height) / np.ptp(x))

    with tempfile.TemporaryDirectory() as folder:
        made = write_records(Path(folder) / "run", "run", "g", None, None, records())
        words = ["rul", str(made), "--out", str(Path(folder) / "rul.csv"), "--limit-ratio", f"{run.limit_ratio:g}"]
        watched = (
            "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, capture_output=True); "
            "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)"
        )
        begin = time.perf_counter()
        typed = [sys.executable, "-c", watched, sys.executable, "-m", "twingap.cli", *words]
        said = subprocess.run(typed, check=True, capture_output=True, text=True)
        return time.perf_counter() - begin, float(said.stdout)
