"""Records of several machines, with and without effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twingap.bearing import BEARINGS
from twingap.effects import Effect
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin


@dataclass(frozen=True)
class Machine:
    """One bearing on one rig; speeds are stated with an error."""

    bearing: str = "6205"
    fs_hz: float = 20000.0
    resonance: float = 0.17
    speeds_rpm: tuple[float, ...] = (1130.0, 1770.0, 2870.0)
    error: float = 0.025

    def records(
        self,
        effects: Sequence[Effect] = (),
        fault: str = "healthy",
        count: int = 3,
        seed: int = 0,
        length_s: float = 1.0,
    ) -> list[tuple[RecordTransforms, float]]:
        """Records, and their true shaft rates over the stated ones."""
        rng = np.random.default_rng(seed)
        at = self.resonance * self.fs_hz
        twin = PhenomenologicalTwin(BEARINGS[self.bearing], PhenomenologicalParameters(resonance_hz=at), list(effects))
        n = round(self.fs_hz * length_s)
        true = [
            Condition(f"r{i}", self.speeds_rpm[i % len(self.speeds_rpm)], self.fs_hz, n, fault) for i in range(count)
        ]
        frame = Frame(BEARINGS[self.bearing], (0.8 * at, 1.2 * at), twin.reference_rms)
        out = []
        for record in twin.stream(true, rng):
            ratio = 1 + self.error * rng.uniform(-1, 1)
            stated = replace(record.condition, speed_rpm=record.condition.speed_rpm / ratio)
            out.append((RecordTransforms(record.samples, stated, frame), ratio))
        return out


MACHINES = [
    Machine("6205", 20000.0, 0.17),
    Machine("PRONOSTIA", 25600.0, 0.3),
    Machine("ZA-2115", 16000.0, 0.2),
    Machine("6203", 12000.0, 0.25),
]
NAMES = [machine.bearing for machine in MACHINES]
