"""Virtual test stand whose records have the layout of those of the CWRU Bearing Data Center's drive end.

One healthy bearing and nine with a seeded defect (inner, ball, outer; 0.007, 0.014 and 0.021 inch), each mounted once
and run at 0, 1, 2 and 3 hp. Only the layout is that of the CWRU records; no value was fitted to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.rigs.machine import Machine
from twingap.rigs.structure import Structure
from twingap.streams import Streams

Array = NDArray[np.float64]
SIZES_INCH = (0.007, 0.014, 0.021)
SPEED_RPM = {0: 1797.0, 1: 1772.0, 2: 1750.0, 3: 1730.0}
RADIAL_LOAD_N = {0: 320.0, 1: 400.0, 2: 490.0, 3: 590.0}
DIGESTS = {
    1.0: "083f168cf7222b8f63da79ce77b0dabaff9b31ca80ca129fca39018df658e6f4",
    10.0: "d9621e3af99e13094b229691d805e646df2f1328bf85b5307467625dbfa68f21",
}
"""sha256 (`twingap.rigs.digest`) of the set of seed 0, by duration in s."""
_BANDS_HZ = ((450, 750), (1000, 1500), (2000, 2800), (2900, 3600), (3800, 4600), (4900, 5600))


@dataclass(frozen=True)
class VirtualCwru:
    """Virtual test stand.

    Parameters
    ----------
    duration_s : float
        Length of each recording, s, from 0.2 to 600.
    fs_hz : float
        Sampling rate, Hz.
    """

    name = "virtual_cwru"
    duration_s: float = 10.0
    fs_hz: float = 12_000.0

    def __post_init__(self) -> None:
        if not 0.2 <= self.duration_s <= 600:
            raise TwingapError(
                f"duration_s = {self.duration_s:g}, between 0.2 and 600 expected", where=f"rig {self.name}"
            )

    def records(self, seed: int = 0) -> RecordSet:
        """All forty recordings, each simulated on access.

        Parameters
        ----------
        seed : int
            Selects machine and bearings; another seed gives another machine of the same kind.

        Returns
        -------
        RecordSet
            Unit g. group = recording; further columns bearing_id (one per mounted bearing), fault_size_inch (0 when
            healthy) and load_hp.
        """
        n = round(self.duration_s * self.fs_hz)
        bearings = [("healthy", 0.0)] + [(fault, size) for fault in ("inner", "ball", "outer") for size in SIZES_INCH]
        conditions, places = [], []
        for index, (fault, size) in enumerate(bearings):
            bearing_id = "healthy" if fault == "healthy" else f"{fault}-{size:.3f}"
            for hp, speed_rpm in SPEED_RPM.items():
                name = f"{bearing_id}-{hp}hp"
                extra = {"bearing_id": bearing_id, "fault_size_inch": size, "load_hp": hp}
                conditions.append(
                    Condition(name, speed_rpm, self.fs_hz, n, fault, RADIAL_LOAD_N[hp], group=name, extra=extra)
                )
                places.append((index, size))
        load = lru_cache(maxsize=len(conditions))(
            lambda place: _recording(seed, *places[place], 4 * places[place][0] + place % 4, conditions[place])
        )
        return RecordSet(self.name, "g", BEARINGS["6205"], conditions, load)


def _recording(seed: int, mounting: int, size_inch: float, recording: int, condition: Condition) -> Array:
    """Samples of one recording of a mounted bearing."""
    stand = Structure.draw(Streams(seed, 0)("structure"), _BANDS_HZ)
    mounted = Streams(seed, 1 + mounting)
    own = mounted("bearing")
    machine = Machine(
        bearing=BEARINGS["6205"],
        structure=stand.remounted(mounted("structure")),
        slip=float(own.uniform(0.0, 0.006)),
        roughness=float(0.012 * np.exp(own.normal(0, 0.1))),
    )
    # Severity is not determined by size alone: edges, burrs and position in the track differ between bearings.
    severity = float(np.exp(own.normal(0, 0.35)))
    rng = Streams(seed, 1000 + recording)("recording")
    speed_rpm = condition.speed_rpm + rng.normal(0, 1.0)  # error of the stated speed
    load_n = condition.load_n or 0.0
    return machine.record(
        speed_rpm, load_n, condition.fault or "healthy", 25.4 * size_inch, severity, condition.n_samples,
        condition.fs_hz, rng,
    )  # fmt: skip
