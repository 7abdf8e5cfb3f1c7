"""A machine and a simulator of a user's own, and the simulator brought to the machine in three ways.

``python -m tests.twingap.gap.own_simulator`` diagnoses ten machines, each in all ways that there are, and prints a
table: names and closures.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.signal import fftconvolve

from twingap.bearing import Bearing
from twingap.effects import make_effect
from twingap.gap import diagnose
from twingap.gap.report.model import GapReport
from twingap.records import Condition, Record, RecordSet
from twingap.twins import TwinSpec, register_callable
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

BEARING: Final = Bearing("6206", 9, 9.525, 46.0)
FS_HZ: Final = 25_600.0
FAULTS: Final = ("healthy", "inner", "outer", "ball")
HUM: Final = 0.2
RAIL: Final = 3.0
SECOND_MODE: Final = (5200.0, 0.03, 0.8)
_LEAD: Final = 4096
_STRENGTH: Final = {"inner": 60.0, "outer": 75.0, "ball": 45.0}

MACHINES: Final[Mapping[str, Mapping[str, Any]]] = {
    "nothing": {},
    "nothing, other records": {"seed": 1},
    "hum": {"hum": HUM},
    "weak hum": {"hum": 0.08},
    "clipping": {"rail": RAIL},
    "second mode": {"modes": (SECOND_MODE,)},
    "hum, clipping": {"hum": HUM, "rail": RAIL},
    "hum, second mode": {"hum": HUM, "modes": (SECOND_MODE,)},
    "clipping, second mode": {"rail": RAIL, "modes": (SECOND_MODE,)},
    "hum, clipping, second mode": {"hum": HUM, "rail": RAIL, "modes": (SECOND_MODE,)},
}
"""What the machine has and the simulator lacks."""
MISSING: Final = {"hum": "mains_interference", "clipping": "clipping", "second mode": "second_resonance"}


def waveform(
    condition: Condition,
    rng: np.random.Generator,
    *,
    hum: float = 0.0,
    rail: float | None = None,
    modes: tuple[tuple[float, float, float], ...] = (),
) -> np.ndarray:
    """Samples of a record, g: impacts with slip through one mode and more, coloured noise, hum, rails."""
    n, fs_hz, shaft_hz = condition.n_samples, condition.fs_hz, condition.speed_rpm / 60
    force = 0.6 * rng.standard_normal(n + _LEAD)
    if condition.fault in _STRENGTH:
        spacing = fs_hz / (BEARING.fault_order(condition.fault) * shaft_hz)
        place = rng.uniform(0, spacing)
        while place < n + _LEAD - 1:
            strength = _STRENGTH[condition.fault] * (1 + 0.15 * rng.standard_normal())
            if condition.fault == "inner":
                strength *= 0.6 + 0.4 * np.cos(2 * np.pi * shaft_hz * place / fs_hz)
            whole = int(place)
            force[whole : whole + 2] += strength * np.array([1 - (place - whole), place - whole])
            place += spacing * (1 + 0.01 * rng.standard_normal())
    t = np.arange(3000) / fs_hz
    response = sum(
        gain * np.exp(-2 * np.pi * f_hz * damping * t) * np.sin(2 * np.pi * f_hz * np.sqrt(1 - damping**2) * t)
        for f_hz, damping, gain in ((1850.0, 0.04, 1.0), *modes)
    )
    x = 0.05 * fftconvolve(force, np.asarray(response))[_LEAD : _LEAD + n]
    coloured = np.fft.rfft(rng.standard_normal(n))
    coloured[1:] *= (np.fft.rfftfreq(n, 1 / fs_hz)[1:] / 1000) ** -0.5
    coloured[0] = 0
    x = x + 0.08 * np.fft.irfft(coloured, n) + 0.02 * rng.standard_normal(n)
    x = x + hum * np.sin(2 * np.pi * 50 * np.arange(n) / fs_hz + rng.uniform(0, 2 * np.pi))
    return np.asarray(x if rail is None else np.clip(x, -rail, rail))


def conditions(each: int = 4, seconds: float = 1.0) -> list[Condition]:
    """Conditions of each state at several speeds."""
    return [
        Condition(f"{fault}{i}", 1200.0 + 203.0 * i, FS_HZ, int(FS_HZ * seconds), fault)
        for fault in FAULTS
        for i in range(each)
    ]


def record_set(name: str, at: list[Condition], seed: int, **more: Any) -> RecordSet:
    """Records of these conditions."""
    rows = (Record(c, waveform(c, np.random.default_rng([seed, i]), **more)) for i, c in enumerate(at))
    return RecordSet.from_records(name, "g", BEARING, rows)


def machine(name: str, each: int = 4) -> RecordSet:
    """Records of one of `MACHINES`."""
    more = dict(MACHINES[name])
    return record_set(name, conditions(each), 100 + more.pop("seed", 0), **more)


def simulated(each: int = 4, replicates: int = 2, seed: int = 900) -> RecordSet:
    """Records of the simulator, several of each condition."""
    at = [replace(c, name=f"{c.name}_{k}") for c in conditions(each) for k in range(replicates)]
    return record_set("own simulator", at, seed)


def function(at: list[Condition], rng: np.random.Generator) -> list[np.ndarray]:
    """The simulator as a function."""
    return [waveform(c, rng) for c in at]


def diagnosed(records: RecordSet, way: str, seed: int = 0) -> GapReport:
    """Quick report on records against the simulator, brought as "sim" or as "function"."""
    if way == "sim":
        spec = TwinSpec("phenomenological", bearing=BEARING)
        return diagnose(records, spec, sim=simulated(), seed=seed, quick=True).report
    register_callable("own simulator", function)
    return diagnose(records, TwinSpec("own simulator", bearing=BEARING), seed=seed, quick=True).report


TWIN: Final = PhenomenologicalParameters(1850.0, 0.04, {"inner": 12.0, "outer": 14.0, "ball": 8.0}, 0.7, 0.6, 0.15)
_SLIP: Final = {"slip_jitter": {"sigma": 0.01}, "impact_scatter": {"sigma": 0.15}}


def twin_machine(name: str, each: int = 4) -> RecordSet:
    """Records of a machine that a twin file describes but for what is missing."""
    more = dict(MACHINES[name])
    effects = [make_effect(n, v) for n, v in _SLIP.items()]
    if "hum" in more:
        effects.append(make_effect("mains_interference", {"level": more["hum"] / TWIN.scale, "n_harmonics": 1}))
    if "rail" in more:
        effects.append(make_effect("clipping", {"rail": 0.6 * more["rail"] / TWIN.scale}))
    for f_hz, damping, gain in more.get("modes", ()):
        values = {"frequency_hz": f_hz, "damping_ratio": damping, "gain": gain}
        effects.append(make_effect("second_resonance", values))
    made = PhenomenologicalTwin(BEARING, TWIN, effects, unit="g")
    return made.simulate(conditions(each), np.random.default_rng(100 + more.get("seed", 0)))


def twin_diagnosed(records: RecordSet, way: str, seed: int = 0) -> GapReport:
    """Quick report on records of `twin_machine` against the same twin, brought in one of three ways."""
    effects = [make_effect(n, v) for n, v in _SLIP.items()]
    twin = PhenomenologicalTwin(BEARING, TWIN, effects, unit="g")
    if way == "file":
        spec = TwinSpec("phenomenological", tuple(_SLIP), parameters=dict(_SLIP), bearing=BEARING)
        return diagnose(records, spec, seed=seed, quick=True).report
    if way == "sim":
        at = [replace(c, name=f"{c.name}_{k}") for c in records.conditions for k in range(2)]
        sim = twin.simulate(at, np.random.default_rng(900))
        return diagnose(records, TwinSpec("phenomenological", bearing=BEARING), sim=sim, seed=seed, quick=True).report

    def made(at: list[Condition], rng: np.random.Generator) -> list[np.ndarray]:
        return [np.asarray(r.samples) for r in twin.simulate(at, rng)]

    register_callable("own twin", made)
    return diagnose(records, TwinSpec("own twin", bearing=BEARING), seed=seed, quick=True).report


def main(names: list[str]) -> None:
    """Print names and closures of ten machines, or of those named, in all ways."""
    rows = []
    for name in names or list(MACHINES):
        records = twin_machine(name)
        for way in ("file", "sim", "function"):
            report = twin_diagnosed(records, way)
            verdict, first = report.verdict, report.metrics[0]
            ci = verdict.closure_ci
            rows.append(
                {"machine": name, "way": way, "status": verdict.status, "effects": ", ".join(sorted(verdict.effects)),
                 "p": round(verdict.p_value, 3), "gap": round(first.before, 2), "floor": round(first.floor, 2),
                 "closure": None if verdict.closure is None else round(verdict.closure, 2),
                 "interval": "" if ci is None else f"{ci[0]:.2f} to {ci[1]:.2f}"}
            )  # fmt: skip
            print(rows[-1], flush=True)
    print(pd.DataFrame(rows).to_string(index=False))


if __name__ == "__main__":
    main(sys.argv[1:])
