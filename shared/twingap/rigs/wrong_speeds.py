"""Virtual machines whose stated speeds are 3 to 6 % wrong, to measure `twingap classify` with.

seed --> bearing, structure, speeds, noise, numbers of faulty bearings --> recordings at true speeds, stated wrongly

Every seed is another machine. Some have a common error (a tachometer that is off), some another error in every
recording (load that is not accounted for); of some, defective balls cause roughness but no line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import PUBLIC_BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.rigs.machine import Machine
from twingap.rigs.rolling import slow_noise
from twingap.rigs.structure import Structure
from twingap.streams import Streams

Array = NDArray[np.float64]
OFF: Final = (0.03, 0.06)
"""Range of the relative error of stated speeds."""
FAULTS: Final = ("healthy", "inner", "outer", "ball")
RATES_HZ: Final = (12_000.0, 16_000.0, 25_600.0)
SPEEDS_RPM: Final = (800.0, 1000.0, 1200.0, 1400.0, 1750.0)
BANDS: Final = ((0.04, 0.07), (0.08, 0.13), (0.15, 0.22), (0.22, 0.30), (0.30, 0.38), (0.38, 0.45))
"""Natural frequencies relative to the sampling rate."""
KINDS: Final = (
    *PUBLIC_BEARINGS.values(), Bearing("NU206", 13, 7.5, 46.0, 0.0), Bearing("7206", 13, 9.525, 46.0, 25.0),
)  # fmt: skip


@dataclass(frozen=True)
class WrongSpeeds:
    """Virtual test stand with wrong speeds.

    Parameters
    ----------
    records_per_class : int
        Mean number of recordings of a state; the shares of the states are random, with at least two of each.

    Raises
    ------
    TwingapError
        For less than 3 recordings.
    """

    name = "wrong_speeds"
    records_per_class: int = 12

    def __post_init__(self) -> None:
        if self.records_per_class < 3:
            raise TwingapError(
                f"records_per_class = {self.records_per_class}, at least 3 expected", where=f"rig {self.name}"
            )

    def records(self, seed: int = 0) -> RecordSet:
        """All recordings, each simulated on access.

        Parameters
        ----------
        seed : int
            Of the machine.

        Returns
        -------
        RecordSet
            Unit g; further columns true_rpm and impacts ("no" for a healthy bearing and for balls without lines).
        """
        rng = Streams(seed, 0)("machine")
        bearing = KINDS[int(rng.integers(len(KINDS)))]
        fs_hz = float(rng.choice(RATES_HZ))
        machine = Machine(
            bearing=bearing,
            structure=Structure.draw(rng, tuple((low * fs_hz, high * fs_hz) for low, high in BANDS)),
            slip=float(rng.uniform(0.0, 0.01)),
            roughness=float(0.012 * np.exp(rng.normal(0, 0.5))),
            unbalance_g=float(np.exp(rng.uniform(np.log(2e-4), np.log(0.01)))),
            background_g=float(0.012 * np.exp(rng.normal(0, 0.7))),
        )
        loads_n = 300.0 * np.exp(rng.normal(0, 0.3)) * np.array([1.0, 1.5])
        speeds_rpm = np.sort(rng.choice(SPEEDS_RPM, int(rng.integers(2, 5)), replace=False))
        lineless, common = bool(rng.random() < 0.4), bool(rng.random() < 0.6)
        weaker = float(np.exp(rng.uniform(np.log(0.3), 0.0)))
        extra = rng.multinomial(len(FAULTS) * (self.records_per_class - 2), rng.dirichlet(np.full(len(FAULTS), 4.0)))
        tachometer = float(rng.uniform(*OFF) * rng.choice([-1, 1]))
        n = round(fs_hz * float(rng.uniform(1.5, 3.5)))
        conditions, sizes_mm, rough = [], [], []
        for fault, number in zip(FAULTS, 2 + extra, strict=True):
            for place in range(int(number)):
                off = tachometer + rng.normal(0, 0.004) if common else rng.uniform(*OFF) * rng.choice([-1, 1])
                off = float(np.sign(off) * np.clip(abs(off), *OFF))
                stated_rpm = float(speeds_rpm[place % speeds_rpm.size])
                silent = fault == "healthy" or (fault == "ball" and lineless)
                known = {"true_rpm": stated_rpm * (1 + off), "impacts": "no" if silent else "yes"}
                name = f"{fault}-{place}"
                load_n = float(loads_n[place % 2])
                conditions.append(Condition(name, stated_rpm, fs_hz, n, fault, load_n, group=name, extra=known))
                sizes_mm.append(float(np.exp(rng.uniform(np.log(0.25), np.log(1.2)))))
                rough.append(float(rng.uniform(1.5, 4.0)) if silent and fault == "ball" else 1.0)

        def simulated(place: int) -> Array:
            condition = conditions[place]
            own = Streams(seed, 1 + place)("recording")
            fault = str(condition.fault) if condition.extra["impacts"] == "yes" else "healthy"
            mounted = replace(
                machine,
                structure=machine.structure.remounted(own),
                roughness=machine.roughness * float(np.exp(own.normal(0, 0.1))),
            )
            severity = weaker * float(np.exp(own.normal(0, 0.35)))
            x = mounted.record(
                float(condition.extra["true_rpm"]), condition.load_n or 0.0, fault, sizes_mm[place], severity, n, fs_hz,
                own,
            )  # fmt: skip
            return x if rough[place] == 1 else _with_rough_ball(x, rough[place], mounted.structure, fs_hz, own)

        return RecordSet(self.name, "g", bearing, conditions, lru_cache(maxsize=len(conditions))(simulated))


def _with_rough_ball(x: Array, rms: float, structure: Structure, fs_hz: float, rng: np.random.Generator) -> Array:
    """A healthy recording with bursts of noise, up to a given RMS over its own: the ball's track wanders."""
    in_track = np.maximum(0.0, 0.55 + 0.45 * slow_noise(rng, x.size, fs_hz, 0.05))
    extra = structure.acceleration(in_track * rng.standard_normal((2, x.size)), fs_hz)
    return np.asarray(x + extra * x.std() / extra.std() * np.sqrt(rms**2 - 1))
