"""A machine as real ones are, against a bare twin: three modes, slip, noise that falls with frequency, hum, clipping.

``python -m tests.twingap.gap.real_machine KIND SEED`` closes the gap and prints what was added and what is left.
"""

from __future__ import annotations

import sys
from typing import Final

import numpy as np
from scipy.signal import fftconvolve

from twingap.bearing import Bearing
from twingap.gap.closing import close
from twingap.records import Condition, Record, RecordSet
from twingap.twins import TwinSpec

BEARING: Final = Bearing("6206", 9, 9.525, 46.0)
FS_HZ: Final = 25_600.0
FAULTS: Final = ("healthy", "inner", "outer", "ball")
HUM: Final = 0.2
RAIL: Final = 10.0
MODES: Final = {
    "a": ((1850.0, 0.04, 1.0), (4200.0, 0.03, 0.7), (8300.0, 0.025, 0.6)),
    "b": ((1250.0, 0.04, 0.8), (2900.0, 0.03, 1.0), (4700.0, 0.03, 0.7)),
}
"""Frequency (Hz), damping ratio and gain of the modes of two machines."""
SPEC: Final = TwinSpec("phenomenological", bearing=BEARING)
_STRENGTH: Final = {"inner": 95.0, "outer": 110.0, "ball": 75.0}
_NOISE: Final = 0.3
_LEAD: Final = 4096


def machine(kind: str, seed: int, each: int = 8, seconds: tuple[float, float] = (1.0, 2.0)) -> RecordSet:
    """Records of each state at random speeds; those of the faster half clip."""
    rng = np.random.default_rng([seed, ord(kind.upper())])
    strength = {fault: level * np.exp(0.15 * rng.standard_normal()) for fault, level in _STRENGTH.items()}
    rows = []
    for place, fault in enumerate(FAULTS):
        for i in range(each):
            n = int(FS_HZ * rng.uniform(*seconds))
            condition = Condition(f"{fault}{i}", float(round(rng.uniform(1200, 2400))), FS_HZ, n, fault)
            own = np.random.default_rng([seed, i, place])
            rows.append(Record(condition, _waveform(condition, kind, strength, own)))
    return RecordSet.from_records(f"machine {kind}{seed}", "g", BEARING, rows)


def _waveform(c: Condition, kind: str, strength: dict[str, float], rng: np.random.Generator) -> np.ndarray:
    """Samples of a record, g."""
    n, shaft_hz = c.n_samples, c.speed_rpm / 60
    force = rng.standard_normal(n + _LEAD)
    if c.fault in strength:
        spacing = FS_HZ / (BEARING.fault_order(c.fault) * shaft_hz)
        place = rng.uniform(0, spacing)
        while place < n + _LEAD - 1:
            impact = strength[c.fault] * (c.speed_rpm / 1800) ** 1.5 * np.exp(0.2 * rng.standard_normal())
            turns = shaft_hz * place / FS_HZ
            if c.fault == "inner":
                impact *= 0.6 + 0.4 * np.cos(2 * np.pi * turns)
            if c.fault == "ball":
                impact *= 0.75 + 0.25 * np.cos(2 * np.pi * 0.4 * turns)
            whole = int(place)
            force[whole : whole + 2] += impact * np.array([1 - (place - whole), place - whole])
            place += spacing * (1 + 0.01 * rng.standard_normal())
    t = np.arange(4000) / FS_HZ
    response = sum(
        gain * np.exp(-2 * np.pi * f * damping * t) * np.sin(2 * np.pi * f * np.sqrt(1 - damping**2) * t)
        for f, damping, gain in MODES[kind]
    )
    x = 0.06 * fftconvolve(force, np.asarray(response))[_LEAD : _LEAD + n]
    f_hz = np.fft.rfftfreq(n, 1 / FS_HZ)
    falling = np.fft.rfft(rng.standard_normal(n))
    falling[1:] /= np.sqrt(f_hz[1:])
    falling[f_hz < 5] = 0
    noise = np.fft.irfft(falling, n)
    x = x + _NOISE * noise / noise.std() + 0.03 * rng.standard_normal(n)
    x = x + HUM * np.sin(2 * np.pi * 50 * np.arange(n) / FS_HZ + rng.uniform(0, 2 * np.pi))
    return np.asarray(np.clip(x, -RAIL, RAIL))


def main(kind: str, seed: int) -> None:
    """Close the gap of one machine and print the way."""
    found = close(machine(kind, seed), SPEC, seed=seed)
    print(found.sentence)
    for one in found.diagnoses:
        verdict, metric = one.report.verdict, one.report.metrics[0]
        print(verdict.status, *verdict.effects, f"gap {metric.before:.3g} to {metric.after:.3g}")
        for candidate in one.report.candidates:
            if candidate.effect in verdict.effects:
                print(" ", candidate.effect, {k: round(v.value, 4) for k, v in candidate.parameters.items()})
    for effect in found.diagnoses[-1].report.closest.effects:
        print("closest:", effect.effect, {k: round(v.value, 4) for k, v in effect.parameters.items()})


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
