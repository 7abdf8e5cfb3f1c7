"""The first answer in a fresh environment, its kernels not yet compiled, against the next one."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.harness import Measurement, Target, ratio

_MEASURED = """
import json, time
begin = time.process_time()
import twingap.gap.api
imported = time.process_time()
from twingap.gap.knowledge.examples import examples
examples(7, range(1), 8)
print(json.dumps({"imports": imported - begin, "features": time.process_time() - imported}))
"""


def measure(quick: bool) -> Measurement:
    """Imports, then all features of one simulated machine, in new processes: empty cache of kernels, then filled.

    Processor time: what runs beside costs less of it than of time on the clock.
    """
    cold, warm = [], []
    for _ in range(1 if quick else 3):
        with tempfile.TemporaryDirectory() as folder:
            cold.append(_process(Path(folder)))
            warm.append(_process(Path(folder)))
    rows: list[dict[str, Any]] = [
        {"kernels": name, **{f"{part}, s": statistics.median(run[part] for run in runs) for part in runs[0]}}
        for name, runs in (("compiled at first call", cold), ("kept from before", warm))
    ]
    share = ratio([sum(run.values()) for run in warm], [sum(run.values()) for run in cold])
    return Measurement(
        "processor time of imports and features of one machine, first and next process", rows,
        (Target("next run as part of the first", share, 0.2),),
        ["floor of the first: imports, and a tenth of a second of type inference per kernel"],
    )  # fmt: skip


def _process(cache: Path) -> dict[str, float]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", _MEASURED]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))
