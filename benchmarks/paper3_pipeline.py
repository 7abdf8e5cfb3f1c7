"""Paper 3's way from records to a trained network: simulation, decomposition, training; and with SciPy and vmdpy.

identification of k and c --> simulated windows --> modes of both domains --> training of the proposed network

Ours runs whole. What SciPy and vmdpy would take is their time for one stretch, or one window, measured in the same run,
times as many as ours made: the whole would take them hours.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from benchmarks.contact import DT, scipy_calls
from benchmarks.harness import Measurement, Target
from twingap.bearing import BEARINGS
from twingap.records import Condition

CLASSES = ("healthy", "inner", "outer", "ball")
WINDOW, FS_HZ, SPEED_RPM = 2048, 12000.0, 1772.0
RECORDINGS, SECONDS = 10, 10.0
"""Unlabelled recordings that are adapted to, as long as CWRU's."""


def measure(quick: bool, seed: int = 0) -> Measurement:
    """One training of profile full, stage by stage, on all cores as far as a stage uses them."""
    import vmdpy

    from papers.paper3_zoa_dann.comparison.jobs import read_options as read_comparison
    from papers.paper3_zoa_dann.inputs.options import read_options
    from papers.paper3_zoa_dann.source import Recipe, identify, simulate
    from twingap.adapt import METHODS, Training, cut, train
    from twingap.twins.contact import ContactTwin
    from twingap.twins.contact_parameters import PRESETS

    options, comparison = read_options(), read_comparison()
    size = comparison.profiles["smoke" if quick else "full"]
    bearing, preset = BEARINGS["6205"], PRESETS[options.source.preset]
    own = Training(**{**vars(comparison.training), "steps": 2 if quick else size.steps, "checkpoints": 2})
    twin = ContactTwin(bearing, preset)
    length = 8192 if quick else int(SECONDS * FS_HZ)
    conditions = [
        Condition(f"r{i}", SPEED_RPM, FS_HZ, length, CLASSES[i % len(CLASSES)], preset.load_n, group=f"r{i}")
        for i in range(RECORDINGS)
    ]
    target = cut(twin.simulate(conditions, np.random.default_rng(seed)), WINDOW, length // WINDOW).unlabelled()
    evaluations = 1 if quick else size.evaluations
    bearings = 2 if quick else size.bearings_per_class
    # Kernels compile, and caches of code fill, before the clock runs.
    comparison.inputs(target.take(np.arange(4)))
    identify(target.take(np.arange(8)), bearing, CLASSES, options.source, options.identification, 0)

    seconds: dict[str, float] = {}

    def timed(stage: str, call: Callable[[], Any]) -> Any:
        begin = time.perf_counter()
        made = call()
        seconds[stage] = time.perf_counter() - begin
        return made

    found = timed(
        "identification",
        lambda: identify(target, bearing, CLASSES, options.source, options.identification, evaluations),
    )
    recipe = Recipe(
        found["stiffness"], found["damping"], found["white_share"], (SPEED_RPM,), FS_HZ, bearing, CLASSES,
        options.source, bearings, size.records_per_bearing, WINDOW, seed,
    )  # fmt: skip
    source = timed("simulation", lambda: simulate(recipe))
    x, y = timed("decomposition", lambda: (comparison.inputs(source), comparison.inputs(target)))
    proposed = METHODS["Proposed"]
    timed(
        "training",
        lambda: train(
            x, source.labels, y, proposed.alignment, own, seed, len(CLASSES), "cpu", proposed.architecture
        ),
    )  # fmt: skip

    per_step, peer = min(
        (statistics.median(_seconds(call, 2 if quick else 7)) / steps, name)
        for name, (call, steps) in scipy_calls(preset).items()
    )
    some = source.samples[:: max(1, len(source) // 12)][: 2 if quick else 12]
    few = comparison.inputs

    def decomposed(window: Any) -> object:
        return vmdpy.VMD(window / window.std(), few.alpha, 0.0, few.n_modes, 0, 1, few.tol)

    vmd = [_seconds(partial(decomposed, window), 1)[0] for window in some]
    in_record = options.source.windows_per_record * WINDOW / FS_HZ
    tried = (evaluations + 1) * len(CLASSES) * options.identification.records_per_class * in_record
    made = len(CLASSES) * bearings * size.records_per_bearing * in_record
    theirs = {
        "identification": tried / DT * per_step, "simulation": made / DT * per_step,
        "decomposition": (len(source) + len(target)) * statistics.mean(vmd), "training": seconds["training"],
    }  # fmt: skip
    amount = {
        "identification": f"{tried:.0f} s of vibration", "simulation": f"{made:.0f} s of vibration",
        "decomposition": f"{len(source) + len(target)} windows", "training": f"{own.steps} steps",
    }  # fmt: skip
    rows: list[dict[str, Any]] = [
        {"stage": stage, "of": amount[stage], "twingap, s": took, "SciPy and vmdpy, s": theirs[stage],
         "times": theirs[stage] / took}
        for stage, took in seconds.items()
    ]  # fmt: skip
    whole = sum(theirs.values()) / sum(seconds.values())
    rows.append({
        "stage": "end to end", "of": "one training", "twingap, s": sum(seconds.values()),
        "SciPy and vmdpy, s": sum(theirs.values()), "times": whole,
    })  # fmt: skip
    return Measurement(
        f"one training of paper 3's proposed network, sizes of profile {'smoke' if quick else 'full'}",
        rows,
        () if quick else (Target("times the same with SciPy and vmdpy, end to end", whole, 10.0),),
        (
            f"{peer} on one core, at our accuracy within a factor of 2, on 5 ms of one outer-race trajectory; vmdpy on "
            f"{len(some)} windows; both times as much as ours made, spectra and effects not counted",
            "several trainings share what was identified and decomposed; here one bears it all",
        ),
    )


def _seconds(call: Callable[[], object], rounds: int) -> list[float]:
    taken = []
    for _ in range(rounds):
        begin = time.perf_counter()
        call()
        taken.append(time.perf_counter() - begin)
    return taken
