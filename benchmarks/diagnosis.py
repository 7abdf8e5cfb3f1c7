"""Time and memory of `twingap gap` on machines of the blind study's generator, against a two-sample test."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.harness import Measurement, Target
from twingap.config import to_toml
from twingap.records.folder import write_record_set
from twingap.rigs.worlds import World, cases, make_world
from twingap.study import rivals
from twingap.study.prepare import prepared
from twingap.study.statistics import table
from twingap.twins.twin_file import read_twin

MACHINES, LARGE = 12, 3
"""Machines of 24 records of 1 s, and of 40 records of 2 s at 25.6 kHz."""
NAMES_S, NAMES_ALL_S, CLOSEST_S, CLOSEST_ALL_S = 15.0, 60.0, 60.0, 180.0
"""Seconds for the names alone, half of the machines and all; and for names, closest twin and attribution."""
LARGE_TAKES: Final = 2.0
"""Times as long for the larger machines."""
MOST_MB: Final = 2048.0
_PLAN: Final = 60
"""Worlds of the plan from which the first are taken: with few, each kind would occur once."""


def measure(quick: bool, seed: int = 0) -> Measurement:
    """Time on the clock of the whole command, from its start to its end, one machine after another."""
    plan = cases(_PLAN, seed)[: 1 if quick else MACHINES]
    small = [replace(case, n_records=24, duration_s=1.0) for case in plan]
    large = [replace(case, n_records=40, duration_s=2.0, fs_hz=25_600.0) for case in plan[: 0 if quick else LARGE]]
    rows = [
        {"records": f"{c.n_records} of {c.duration_s:g} s"} | _diagnosed(make_world(c, seed)) for c in small + large
    ]

    def of(column: str, machines: slice) -> list[float]:
        return [float(row[column]) for row in rows[machines]]

    first, last = slice(None, len(small)), slice(len(small), None)
    targets: list[Target] = []
    for column, half, most in (("names, s", NAMES_S, NAMES_ALL_S), ("with closest twin, s", CLOSEST_S, CLOSEST_ALL_S)):
        spent = of(column, first)
        targets += [
            Target(f"{half:g} s over the median: {column}", half / statistics.median(spent), 1.0),
            Target(f"{most:g} s over the longest: {column}", most / max(spent), 1.0),
        ]
        if large:
            half *= LARGE_TAKES
            longer = statistics.median(of(column, last))
            targets += [Target(f"{half:g} s over the median, {LARGE} larger machines: {column}", half / longer, 1.0)]
    targets += [Target(f"{MOST_MB:g} MB over the peak memory", MOST_MB / max(of("MB", slice(None))), 1.0)]
    return Measurement(
        f"`twingap gap` on {len(small)} machines of {small[0].n_records} records of 1 s, and {len(large)} larger ones",
        rows,
        () if quick else targets,
        [
            "names: --quick. Time on the clock, start of Python and imports included; MB: the larger peak of both.",
            "forest: a two-sample test by a random forest (39 permutations), calibration of the twin included.",
        ],
    )


def _diagnosed(world: World) -> dict[str, Any]:
    """Seconds of both diagnoses and of the two-sample test, and peak memory, MB."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        write_record_set(world.records, here / "records")
        (here / "twin.toml").write_text(to_toml(world.twin), encoding="utf-8")
        words = ["gap", str(here / "records"), "--twin", str(here / "twin.toml"), "--no-track"]
        if world.sim is not None:
            write_record_set(world.sim, here / "sim")
            words = ["gap", str(here / "records"), "--sim", str(here / "sim"), "--no-track"]
        names, quick_mb = _command([*words, "--quick", "--out", str(here / "quick")])
        closest, closest_mb = _command([*words, "--out", str(here / "closest")])
        begin = time.perf_counter()
        rng = np.random.default_rng(world.seed)
        real, made = prepared(world.records, read_twin(here / "twin.toml"), rng, world.sim)
        rivals.two_sample(table(real), table(made), rng)
        forest = time.perf_counter() - begin
    effects = [name for name, _ in (*world.case.effects, *world.case.uncatalogued)]
    return {
        "simulator": "own" if world.sim is not None else "twin", "missing": ", ".join(effects) or "nothing",
        "names, s": f"{names:.1f}", "with closest twin, s": f"{closest:.1f}", "MB": f"{max(quick_mb, closest_mb):.0f}",
        "forest, s": f"{forest:.1f}", "names, times the forest": names / forest,
    }  # fmt: skip


def _command(words: list[str]) -> tuple[float, float]:
    """Seconds and greatest resident memory, MB, of a command."""
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "twingap.cli", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, words)
    return time.perf_counter() - begin, usage.ru_maxrss / 1024
