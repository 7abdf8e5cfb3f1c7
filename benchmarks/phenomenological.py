"""The phenomenological twin against eq. 1 of paper 1 as people publish it: impulse train and `fftconvolve`."""

from __future__ import annotations

import os
import statistics
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from benchmarks.harness import Measurement, Target, in_turn, ratio
from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.records import Condition
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin, paper1_chain

Array = NDArray[np.float64]

FS_HZ, SAMPLES, SPEED_RPM = 12000.0, 12000, 1800.0
ONE_PER_STAGE = ("speed_fluctuation", "slip_jitter", "second_resonance", "shaft_harmonics", "clipping")
DEAREST = ("speed_fluctuation", "distributed_roughness", "sensor_rolloff", "coloured_noise", "dropout")


def measure(quick: bool) -> Measurement:
    """Records per second of one second at 12 kHz with five effects, ours and the peer's (fewer records when quick)."""
    count, rounds = (20, 3) if quick else (200, 5)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    chains: dict[str, Sequence[Effect]] = {
        "eq. 1 of paper 1": paper1_chain(),
        "one effect a stage": [make_effect(name) for name in ONE_PER_STAGE],
        "the five dearest effects": [make_effect(name) for name in DEAREST],
    }
    parameters = PhenomenologicalParameters()
    conditions = [Condition(f"{i}", SPEED_RPM, FS_HZ, SAMPLES, "inner", time_s=60.0 * i) for i in range(count)]

    def ours(chain: Sequence[Effect], threads: int) -> None:
        twin = PhenomenologicalTwin(BEARINGS["6205"], parameters, chain)
        for _ in twin.stream(conditions, np.random.default_rng(0), threads):
            pass

    rivals: dict[str, Callable[[], object]] = {
        "peer": partial(_published, conditions, parameters),
        "floor": partial(_floor, count),
    }
    for name, chain in chains.items():
        for threads in sorted({1, min(2, cores)}):
            rivals[f"{name}, {threads} thread{'s' * (threads > 1)}"] = partial(ours, chain, threads)
    seconds = in_turn(rivals, rounds)
    names = {"peer": "eq. 1 with fftconvolve (NumPy, SciPy)", "floor": "floor: the noise drawn, nothing else"}
    rows: list[dict[str, Any]] = [
        {
            "made by": names.get(name, f"twingap: {name}"),
            "records/s": round(count / statistics.median(taken)),
            "times the peer": round(ratio(seconds["peer"], taken), 2),
            "times the floor's time": round(ratio(taken, seconds["floor"]), 2),
        }
        for name, taken in seconds.items()
    ]
    best = {
        name: max(count / statistics.median(taken) for rival, taken in seconds.items() if rival.startswith(name))
        for name in chains
    }
    paper = max(
        ratio(seconds["peer"], taken) for rival, taken in seconds.items() if rival.startswith("eq. 1 of paper 1")
    )
    targets = [Target(f"records/s with five effects ({name}), two cores", value, 500.0) for name, value in best.items()]
    targets.append(Target("eq. 1 of paper 1: times as fast as with fftconvolve", paper, 1.0))
    notes = [
        "The floor is one core drawing a record's 24,000 normal numbers (structure and white noise) with the generator "
        "that the twin uses; what effects draw and any arithmetic comes on top.",
        "The peer places impacts on the nearest sample and convolves; ours strike between samples, in angle, through "
        "effects that can each be left out. Both draw the same amount of noise.",
        "Two threads gain what NumPy and the kernels do outside the interpreter's lock; the bytes stay the same.",
    ]
    return Measurement(
        f"{count} one-second records at 12 kHz, inner race fault of a 6205 at 1800 rpm, five effects",
        rows,
        targets,
        notes,
    )


def _floor(count: int) -> None:
    """The random numbers of the baseline, into memory that is there already."""
    rng, x = np.random.Generator(np.random.SFC64(0)), np.empty(SAMPLES)
    for _ in range(2 * count):
        rng.standard_normal(out=x)


def _published(conditions: Sequence[Condition], parameters: PhenomenologicalParameters) -> None:
    """S(k) D(k) sum_i h(t - iT - tau_i) q(iT) A_i + n(t) in plain NumPy and SciPy, record by record."""
    rng, bearing = np.random.default_rng(0), BEARINGS["6205"]
    for condition in conditions:
        _published_record(condition, parameters, bearing.bpfi, rng)


def _published_record(
    condition: Condition, parameters: PhenomenologicalParameters, order: float, rng: np.random.Generator
) -> Array:
    fs, n, rate = condition.fs_hz, condition.n_samples, condition.speed_rpm / 60
    w, zeta, period = 2 * np.pi * parameters.resonance_hz, parameters.damping_ratio, 1 / (order * rate)
    t = np.arange(1024) / fs
    h = np.exp(-zeta * w * t) * np.sin(np.sqrt(1 - zeta**2) * w * t)
    places = np.arange(0, n / fs, period) + period * rng.random()
    struck = np.rint((places + 0.02 * period * rng.standard_normal(places.size)) * fs).astype(int)
    q = 1 + 0.3 * np.cos(2 * np.pi * rate * places)
    amplitudes = q * (1 + 0.1 * rng.standard_normal(places.size))
    inside = (struck >= 0) & (struck < n)
    train = np.zeros(n)
    np.add.at(train, struck[inside], amplitudes[inside])
    gain = rate * 60 / 1000 * np.exp(1e-3 * (condition.time_s or 0.0)) * parameters.impact_amplitude["inner"]
    x = gain * fftconvolve(train, h)[:n]
    structure = fftconvolve(rng.standard_normal(n), h)[:n]
    x += parameters.structure_noise_rms * structure / structure.std()
    x += parameters.white_noise_rms * rng.standard_normal(n)
    return np.asarray(x)
