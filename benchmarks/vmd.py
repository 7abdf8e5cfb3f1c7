"""Batched variational mode decomposition against vmdpy, on the same signals in the same run."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness import Measurement, Target, in_turn, ratio
from twingap.signal import Modes, vmd

Array = NDArray[np.float64]

SAMPLES, MODES, ALPHA, TOLERANCE = 2048, 4, 2000.0, 1e-7

_PEAK = """
import re, sys
from pathlib import Path
import numpy as np
from twingap.signal import vmd
status, reset = Path("/proc/self/status"), Path("/proc/self/clear_refs")
def kib(key):
    return int(re.search(key + r":\\s+(\\d+)", status.read_text())[1])
x = np.random.default_rng(0).standard_normal((int(sys.argv[1]), int(sys.argv[2])))
vmd(x[:64], 4, max_iterations=5)
reset.write_text("5")
before = kib("VmRSS")
modes = vmd(x, 4, max_iterations=20)
print((kib("VmHWM") - before) * 1024 / x.nbytes)
"""


def measure(quick: bool) -> Measurement:
    """Time, agreement and memory on 64 signals of 2048 samples, K = 4 (8 signals when quick)."""
    import vmdpy

    def peer(signals: Array) -> list[tuple[Array, Array]]:
        found = [vmdpy.VMD(row, ALPHA, 0.0, MODES, 0, 1, TOLERANCE) for row in signals]
        return [(modes, centres) for modes, _, centres in found]

    def ours(signals: Array, threads: int | None = None) -> Modes:
        return vmd(signals, MODES, alpha=ALPHA, tol=TOLERANCE, threads=threads)

    count, rounds = (8, 3) if quick else (64, 3)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    rows: list[dict[str, Any]] = []
    ratios, differences, notes = [], [], []
    for name, signals in _signals(count).items():
        rivals: dict[str, Callable[[], object]] = {
            "vmdpy": partial(peer, signals),
            "twingap, 1 thread": partial(ours, signals, 1),
            "twingap": partial(ours, signals),
        }
        seconds = in_turn(rivals, rounds)
        mine, theirs = ours(signals), peer(signals)
        difference = max(
            float(np.linalg.norm(a - b) / np.linalg.norm(b))
            for (modes, _), own in zip(theirs, mine.values, strict=True)
            for a, b in zip(own, modes, strict=True)
        )
        agree = sum(len(centres) == n for (_, centres), n in zip(theirs, mine.iterations, strict=True))
        differences.append(difference)
        ratios.append(ratio(seconds["vmdpy"], seconds["twingap"]))
        floor = int(mine.iterations.sum()) * MODES * signals.shape[1] * _seconds_per_division()
        single = statistics.median(seconds["twingap, 1 thread"])
        notes.append(
            f"{name}: {agree} of {len(signals)} signals take as many iterations as with vmdpy; floor on one core (one "
            f"division a bin, mode and iteration, at the speed of this run) {floor / len(signals) * 1e3:.2f} ms a "
            f"signal, distance {single / floor:.1f}"
        )
        for rival, times in seconds.items():
            rows.append(
                {
                    "signals": name,
                    "rival": rival,
                    "ms per signal": 1e3 * statistics.median(times) / len(signals),
                    "times vmdpy": ratio(seconds["vmdpy"], times),
                    "largest relative difference": 0.0 if rival == "vmdpy" else difference,
                }
            )
    traced = _traced_multiple(_signals(64)["simulated"], ours)
    resident = _resident_multiple(64 if quick else 1024)
    worst = max(traced, resident or 0.0)
    notes += [
        f"{cores} cores visible; memory in multiples of the input, modes (K = {MODES} times the input) included: NumPy "
        f"arrays at their peak {traced:.1f}"
        + ("" if resident is None else f", resident set of a fresh process at its peak {resident:.1f}"),
    ]
    return Measurement(
        f"variational mode decomposition, {count} x {SAMPLES} samples, K = {MODES}, alpha {ALPHA:g}, tau 0, tol 1e-7",
        rows,
        (
            Target("times vmdpy, per signal", min(ratios), 25.0),
            Target("1e-6 over the largest relative difference of a mode", 1e-6 / max(max(differences), 1e-300), 1.0),
            Target("input over peak memory", 1 / worst, 1 / 20),
        ),
        notes,
    )


def _signals(count: int) -> dict[str, Array]:
    """Impacts ringing at two resonances in noise, rms 1; and windows of a real record where one is at hand."""
    rng = np.random.default_rng(2014)
    fs_hz = 12000.0
    t = np.arange(SAMPLES) / fs_hz
    signals = rng.standard_normal((count, SAMPLES))
    for row in signals:
        for resonance_hz, amplitude in ((3400.0, 4.0), (1500.0, 2.0)):
            since = (t + rng.uniform(0, 0.01)) % (1 / 162.0)
            row += (
                amplitude * np.exp(-0.05 * 2 * np.pi * resonance_hz * since) * np.sin(2 * np.pi * resonance_hz * since)
            )
    found = {"simulated": signals / signals.std(axis=-1, keepdims=True)}
    record = Path(os.environ.get("TWINGAP_DATA", "")) / "cwru" / "105.mat"
    if "TWINGAP_DATA" in os.environ and record.is_file():
        from scipy.io import loadmat

        samples = loadmat(record)["X105_DE_time"].ravel().astype(np.float64)
        windows = samples[: count * SAMPLES // 2 + SAMPLES]
        real = np.lib.stride_tricks.sliding_window_view(windows, SAMPLES)[:: SAMPLES // 2][:count]
        found["CWRU 105, overlapping windows"] = real / real.std(axis=-1, keepdims=True)
    return found


def _seconds_per_division() -> float:
    """Of float64 in the first-level cache, vectorised, by this machine now: the one slow step that each bin needs."""
    import numba

    @numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
    def divide(above: Array, below: Array, out: Array, repeats: int) -> None:
        for _ in range(repeats):
            for i in range(out.size):
                out[i] = above[i] / below[i]

    above, below, out = np.ones(1024), np.full(1024, 3.0), np.zeros(1024)
    divide(above, below, out, 1)
    best = float("inf")
    for _ in range(5):
        begin = time.perf_counter()
        divide(above, below, out, 2000)
        best = min(best, time.perf_counter() - begin)
    return best / (2000 * out.size)


def _traced_multiple(signals: Array, ours: Any) -> float:
    """Peak of NumPy's memory while decomposing, over the input's. The kernel itself allocates K numbers."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        ours(signals)
        return (tracemalloc.get_traced_memory()[1] - before) / signals.nbytes
    finally:
        tracemalloc.stop()


def _resident_multiple(count: int) -> float | None:
    """Rise of a fresh process's peak resident set, over the input's size; None where the system does not tell."""
    if not Path("/proc/self/clear_refs").exists():
        return None
    done = subprocess.run(
        [sys.executable, "-c", _PEAK, str(count), str(SAMPLES)], capture_output=True, text=True, check=False
    )
    return float(done.stdout) if done.returncode == 0 else None
