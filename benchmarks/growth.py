"""How cost grows: simulated records by their number, length and effects; a diagnosis by records and their length; the
summary and page of a fleet by its machines.

Processor time, so that what runs beside costs little of it. An exponent of 1 is proportional growth.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from benchmarks.harness import Measurement, Target
from twingap.bearing import BEARINGS
from twingap.effects import make_effect, trainable
from twingap.fleet.page import page
from twingap.fleet.summary import Machine, fleet_of
from twingap.gap import diagnose
from twingap.records import Condition, RecordSet
from twingap.twins.base import Twin
from twingap.twins.contact import ContactTwin
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

FS_HZ = 12000.0
BEARING = BEARINGS["6205"]
EFFECTS = (
    "speed_fluctuation", "slip_jitter", "second_resonance", "shaft_harmonics", "clipping", "distributed_roughness",
    "sensor_rolloff", "coloured_noise", "dropout", "entry_exit",
)  # fmt: skip
MOST = 1.15
"""Exponent up to which growth counts as proportional."""

Series = tuple[str, str, Sequence[float], Callable[[float], object]]
"""What is done, what grows, its sizes, and a call for a size."""


def measure(quick: bool) -> Measurement:
    """Processor seconds of each series of sizes, the best of three calls (one when quick, of the smallest sizes)."""
    n = 8 if quick else 64
    series: list[Series] = [
        ("phenomenological twin", "records", (n, 2 * n, 4 * n, 8 * n), lambda size: _simulate(int(size), 1.0)),
        ("phenomenological twin", "seconds of a record", (0.5, 1.0, 2.0, 4.0), partial(_simulate, n)),
        ("phenomenological twin", "effects", (1, 2, 5, 10), lambda size: _simulate(n, 1.0, int(size))),
        ("contact twin", "records", (n, 2 * n, 4 * n), lambda size: _simulate(int(size), 1.0, 0, ContactTwin)),
        ("contact twin", "seconds of a record", (0.5, 1.0, 2.0), lambda size: _simulate(n, size, 0, ContactTwin)),
    ]
    machines = (25, 50) if quick else (250, 1000, 5000)
    series.append(("summary and page of a fleet", "machines", machines, lambda size: _summarise(int(size))))
    if not quick:
        series += [
            ("diagnosis", "records", (8, 16, 32), lambda size: _diagnose(int(size), 1.0)),
            ("diagnosis", "seconds of a record", (0.5, 1.0, 2.0), partial(_diagnose, 16)),
        ]
    rows: list[dict[str, Any]] = []
    exponents: dict[str, float] = {}
    for what, grows, sizes, call in series:
        rounds = 1 if quick or what == "diagnosis" else 3
        seconds = [_processor_s(partial(call, size), rounds) for size in sizes]
        exponent = math.log(seconds[-1] / seconds[0]) / math.log(sizes[-1] / sizes[0])
        exponents[f"{what}, {grows}"] = exponent
        for size, took in zip(sizes, seconds, strict=True):
            rows.append({
                "what": what, "grows": grows, "size": size, "s": float(f"{took:.3g}"),
                "times the first": round(took / seconds[0], 2), "exponent": round(exponent, 2),
            })  # fmt: skip
    targets = [Target(f"{MOST:g} over the exponent of growth: {name}", MOST / max(e, 0.01), 1.0)
               for name, e in exponents.items()]  # fmt: skip
    notes = ["Batches and threads are those of the twin's defaults, processor time is that of all threads."]
    return Measurement("processor time as the work grows", rows, targets, notes)


def _processor_s(call: Callable[[], object], rounds: int) -> float:
    took = []
    for _ in range(rounds):
        begin = time.process_time()
        call()
        took.append(time.process_time() - begin)
    return max(min(took), 1e-6)


def _conditions(count: int, seconds: float) -> list[Condition]:
    faults = ("healthy", "outer", "inner", "ball")
    return [
        Condition(f"r{i}", 1500.0 + 300.0 * (i // 4 % 2), FS_HZ, round(seconds * FS_HZ), faults[i % 4])
        for i in range(count)
    ]


def _simulate(count: int, seconds: float, effects: int = 5, model: Callable[..., Twin] = PhenomenologicalTwin) -> None:
    twin = model(BEARING, effects=[make_effect(name) for name in EFFECTS[:effects]])
    for _ in twin.stream(_conditions(count, seconds), np.random.default_rng(0)):
        pass


def _diagnose(count: int, seconds: float) -> None:
    machine = PhenomenologicalTwin(BEARING, effects=[make_effect("slip_jitter"), make_effect("coloured_noise")])
    made = machine.stream(_conditions(count, seconds), np.random.default_rng(1))
    records = RecordSet.from_records("machine", "g", BEARING, made)
    diagnose(records, TwinSpec("phenomenological", effects=("slip_jitter",)), seed=0, quick=True)


def _summarise(count: int) -> None:
    rng, names = np.random.default_rng(2), list(trainable())
    machines = []
    for number in range(count):
        probability = dict(zip(names, rng.beta(0.1, 1.0, len(names)).tolist(), strict=True))
        missing = tuple(name for name, chance in probability.items() if chance > 0.5)
        machines.append(Machine(
            f"m{number}", "explained" if missing else "no_gap", effects=missing, sentence="", p_value=0.01, before=1.0,
            after=0.5, floor=0.1, closure=0.5, closure_ci=(0.4, 0.6), probability=probability,
        ))  # fmt: skip
    page(fleet_of(machines, {"folder": "fleet", "twin": "twin.toml"}))
