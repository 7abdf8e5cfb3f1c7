"""`twingap rul` on the virtual rig's runs (surrogate): error and intervals, without and with the bench's other runs.

bench, bearing --rig--> peak to peak, speed [rows] --OnlineLife--> estimates --errors, lives of the others--> again
                                                                       |                                        |
                                                                       +---------- table: RMSE, coverage -------+

The rig is another simulator than any that intervals are calibrated on; the limit of 15 g is given, as in the paper.
What the other runs say is what they showed by their own ends; the run judged has no part in it.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from papers.framework import Work
from twingap.rigs import SmartMaintenanceRig


@dataclass(frozen=True)
class Size:
    benches: tuple[int, ...]
    bearings: tuple[str, ...]
    interval_s: float
    duration_s: float


@dataclass(frozen=True)
class Options:
    profiles: dict[str, Size]


@dataclass(frozen=True)
class Bench:
    seed: int
    bearing: str
    interval_s: float
    duration_s: float


def amplitudes(job: Bench) -> dict[str, Any]:
    """Time, speed and peak to peak of every snapshot [rows], one of them in memory at a time."""
    rig = SmartMaintenanceRig(job.interval_s, job.duration_s, bearings=(job.bearing,))
    records = rig.records(job.seed)
    return {
        "time_s": np.array([c.time_s for c in records.conditions], float),
        "speed_rpm": np.array([c.speed_rpm for c in records.conditions]),
        "peak_to_peak_g": np.array([float(np.ptp(record.samples)) for record in records]),
    }


def jobs(work: Work) -> Iterator[Bench]:
    """Every bearing on every bench; the run's seed is added to the benches'."""
    for bench, bearing in itertools.product(work.size.benches, work.size.bearings):
        yield Bench(work.seed + bench, bearing, work.size.interval_s, work.size.duration_s)
