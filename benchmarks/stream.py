"""One-second records streamed through memory and through files: records per second, and whether memory stays constant.

Each stream runs for a fixed processor time in a process of its own; what a million records take is extrapolated.
"""

from __future__ import annotations

import gc
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.harness import Measurement, Target
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.records import Condition, Record
from twingap.records.folder import read_record_set, write_records
from twingap.twins.phenomenological import PhenomenologicalTwin

FS_HZ, SAMPLES, MILLION = 12000.0, 12000, 1_000_000
EFFECTS = ("speed_fluctuation", "slip_jitter", "second_resonance", "shaft_harmonics", "clipping")
NAMES: Final = {
    "memory": "simulated, added to a mean spectrum",
    "write": "simulated, written to a record set",
    "read": "read from that record set",
}


def measure(quick: bool) -> Measurement:
    """Rate and memory of each stream, run for 10 s of processor time (1 s when quick)."""
    seconds = 1.0 if quick else 10.0
    with tempfile.TemporaryDirectory() as folder:
        done = {name: _process(name, seconds, Path(folder)) for name in NAMES}
    rows = [
        {
            "one-second records at 12 kHz": NAMES[name],
            "records": one["records"],
            "records/s": round(one["records"] / one["s"]),
            "MB at first": round(one["first"][1], 1),
            "MB at the end": round(one["last"][1], 1),
            "hours for a million": round(MILLION * one["s"] / one["records"] / 3600, 2),
            "MB at a million": round(_at_a_million(one)),
        }
        for name, one in done.items()
    ]
    one = done["memory"]
    targets = [
        Target("records in an hour, simulated, over a million", 3600 * one["records"] / one["s"] / MILLION, 1.0),
        Target("1.02 over the growth of memory, simulated", 1.02 * one["first"][1] / one["last"][1], 1.0),
        Target("3000 MB over what a million written records hold", 3000 / _at_a_million(done["write"]), 1.0),
    ]
    notes = [
        "One core, processor time; resident memory, first when a tenth of the time has passed, and for reading before "
        "the set is opened. Samples are held for a batch only; a record set keeps a row of its table for each record. "
        "Memory at a million continues the line through both points."
    ]
    return Measurement(
        f"five effects, {seconds:g} s of processor time for each stream of one-second records", rows, targets, notes
    )


def _at_a_million(one: dict[str, Any]) -> float:
    """Memory on the line through the first point and the last, MB."""
    (n, first), (m, last) = one["first"], one["last"]
    return float(last + (last - first) * (MILLION - m) / max(m - n, 1))


def _process(name: str, seconds: float, folder: Path) -> dict[str, Any]:
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.stream", name, str(seconds), str(folder)], check=True, text=True,
        stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    return dict(json.loads(done.stdout.splitlines()[-1]))


def _held_mb() -> float:
    """Resident memory; its peak where the system does not tell."""
    gc.collect()
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024**2 if sys.platform == "darwin" else 1024)
    return pages * resource.getpagesize() / 1024**2


class Watched:
    """Iterator over records that ends after a processor time; notes memory after a tenth of it and at the end."""

    def __init__(self, records: Iterator[Record], seconds: float, first: tuple[int, float] | None = None) -> None:
        self.records, self.seconds, self.first = records, seconds, first
        self.count, self.last, self.began = 0, (0, 0.0), time.process_time()

    def __iter__(self) -> Iterator[Record]:
        for record in self.records:
            yield record
            self.count += 1
            passed = time.process_time() - self.began
            if self.first is None and passed > self.seconds / 10:
                self.first = self.count, _held_mb()
            if passed > self.seconds:
                break
        self.last = self.count, _held_mb()

    def report(self) -> dict[str, Any]:
        """Number of records, seconds, memory in MB at two numbers of records."""
        seconds = time.process_time() - self.began
        return {"records": self.count, "s": seconds, "first": self.first or self.last, "last": self.last}


def _simulated() -> Iterator[Record]:
    twin = PhenomenologicalTwin(BEARINGS["6205"], effects=[make_effect(name) for name in EFFECTS])
    faults = ("healthy", "inner", "outer", "ball")
    conditions = (Condition(f"{i}", 900.0 + i % 1500, FS_HZ, SAMPLES, faults[i % 4]) for i in range(MILLION))
    return twin.stream(conditions, np.random.default_rng(0), threads=1)


def _in_memory(seconds: float, folder: Path) -> Watched:
    watched, total = Watched(_simulated(), seconds), np.zeros(SAMPLES // 2 + 1)
    for record in watched:
        total += np.abs(np.fft.rfft(record.samples))
    return watched


def _written(seconds: float, folder: Path) -> Watched:
    watched = Watched(_simulated(), seconds)
    write_records(folder / "set", "stream", "g", BEARINGS["6205"], None, watched)
    return watched


def _read(seconds: float, folder: Path) -> Watched:
    before = 0, _held_mb()
    watched = Watched(iter(read_record_set(folder / "set")), seconds, before)
    for record in watched:
        assert np.isfinite(record.samples).all()
    return watched


STREAMS: Final[dict[str, Callable[[float, Path], Watched]]] = {
    "memory": _in_memory,
    "write": _written,
    "read": _read,
}


if __name__ == "__main__":
    next(_simulated())  # kernels are loaded before the clock runs
    print(json.dumps(STREAMS[sys.argv[1]](float(sys.argv[2]), Path(sys.argv[3])).report()))
