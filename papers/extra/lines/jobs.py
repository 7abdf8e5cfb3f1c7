"""Study of recordings that show the line of their own fault, compared with recordings without the fault.

recording, sensor --five bands--> squared-envelope spectra --orders--> prominence of each fault's line, highest band
                                                                                                |
        by data set, sensor and fault: recordings with it, against healthy ones and all without it --> counts

Used in: Paper 2, section 3, diagnosis without fault data. Lines at the orders of faults stand out of healthy records
too, and an inner line out of those of outer races, so that a floor says little: what a line is worth is seen beside
recordings that lack the fault. Healthy ones are few, and other faults have lines of their own at this one's order, so
both references are given. Labels are read here: this judges recordings, and nothing learns from it.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from papers.arrays import Array
from papers.framework import Work
from papers.paper2_digital_twin.availability.records import RATE_HZ, TITLES
from twingap import Bearing, RecordSet, TwingapError
from twingap import data as datasets
from twingap.signal import Spectrum, lines_at, squared_envelope_spectrum

RIG: Final = "virtual_cwru"
FAULTS: Final = ("inner", "outer", "ball")
HEALTHY: Final = "healthy"
ONLY: Final = "one"  # name of the sensor where there is one alone


@dataclass(frozen=True)
class Size:
    rig_duration_s: float
    smoke: bool


@dataclass(frozen=True)
class Options:
    data: tuple[str, ...]
    bands: tuple[tuple[float, float], ...]
    harmonics: int
    tolerance: float
    shortest_s: float
    longest_s: float
    sensors: dict[str, tuple[str, ...]]
    profiles: dict[str, Size]


def prominences(x: Array, fs_hz: float, turn_hz: float, bearing: Bearing, options: Options) -> Array:
    """How far the line of each fault stands out of the squared-envelope spectrum of each band of x [samples]: line over
    local median, geometric mean over harmonics [bands, faults]."""
    rows = []
    for low, high in options.bands:
        hz, values = squared_envelope_spectrum(x, fs_hz, (low * fs_hz, high * fs_hz), window="hann")
        over = Spectrum(hz / turn_hz, values)
        each = [
            lines_at(over, bearing.fault_order(fault), harmonics=options.harmonics, tolerance=options.tolerance)
            for fault in FAULTS
        ]
        rows.append([float(np.exp(np.log(lines.prominence).mean())) for lines in each])
    return np.array(rows)


def read(records: RecordSet, sensor: str, options: Options) -> pd.DataFrame:
    """A row for each recording of a sensor that is long enough, healthy ones too; columns of faults: prominence in the
    band where it is highest."""
    if records.bearing is None:
        raise TwingapError(f"{records.name} names no bearing, and so no order of a fault")
    rows = []
    for i, about in enumerate(records.conditions):
        if about.fault not in (HEALTHY, *FAULTS) or about.n_samples < options.shortest_s * about.fs_hz:
            continue
        x = records[i].samples[: round(options.longest_s * about.fs_hz)]
        found = prominences(x, about.fs_hz, about.speed_rpm / 60, records.bearing, options)
        largest = found.max(axis=0)
        own = FAULTS.index(about.fault) if about.fault in FAULTS else None
        rows.append({
            "recording": about.group or about.name, "bearing": about.extra.get("bearing_id", ""),
            "speed_rpm": about.speed_rpm, "length_s": x.size / about.fs_hz, "class": about.fault, "sensor": sensor,
            **dict(zip(FAULTS, largest, strict=True)),
            "bands where the own line is the highest":
                np.nan if own is None else float((found.argmax(axis=1) == own).sum()),
            "highest": FAULTS[int(largest.argmax())],
        })  # fmt: skip
    if not rows:
        raise TwingapError(f"{records.name} has no recording of {options.shortest_s:g} s", mend="lower shortest_s")
    return pd.DataFrame(rows)


def load(options: Options, size: Size, root: Path | None) -> dict[tuple[str, str], RecordSet]:
    """Sensors of the data sets that are at hand; the virtual rig when none is."""
    sets: dict[tuple[str, str], RecordSet] = {}
    for name in options.data[:1] if size.smoke else options.data:
        sensors = options.sensors.get(name, (ONLY,))
        for sensor in sensors[:1] if size.smoke else sensors:
            channel = {} if sensor == ONLY else {"channel": sensor}
            try:
                sets[name, sensor] = datasets.load(name, root, fs_hz=RATE_HZ[name], **channel)
            except datasets.NotAtHandError:
                # Without its first sensor a data set is not at hand; one that is must have all that are asked for.
                if root is not None or sensor != sensors[0]:
                    raise
                break
    return sets or {(RIG, ONLY): datasets.load(RIG, duration_s=size.rig_duration_s)}


def rows(work: Work) -> pd.DataFrame:
    """A row for each recording and sensor; nothing is drawn by lot, and a minute needs no workers."""
    sets, parts = load(work.options, work.size, work.root), []
    work.title = ", ".join(dict.fromkeys(TITLES[name] for name, _ in sets))
    for done, ((name, sensor), records) in enumerate(sets.items(), 1):
        parts.append(read(records, sensor, work.options).assign(data=TITLES[name]))
        work.progress("lines, sensors", done, len(sets))
    found = pd.concat(parts, ignore_index=True)
    found.insert(0, "data", found.pop("data"))
    return found
