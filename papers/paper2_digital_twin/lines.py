"""Which recordings show the line of their own fault: what any diagnosis by lines can reach without a label.

recording, sensor --five bands--> squared-envelope spectra --lines at fault orders--> own line above noise, above others
white noise --------------------------------------------------------------------------------^
                                                            by recording --> by class and sensor

Used in: Paper 2, section 3, diagnosis without fault data. A network that learns from simulated bearings expects each
fault at its own order; a recording that shows another fault's line misleads it, whatever it has learnt. Labels are read
here to say which: this judges recordings, and nothing learns from it. Run as part of the paper, or alone:
python -m papers.paper2_digital_twin.lines --profile full --out DIR
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import twingap.signal
from papers.paper2_digital_twin.availability_records import RATE_HZ, TITLES
from papers.studies import Count, Progress, command, keep_tables, profile_of
from twingap import data as datasets
from twingap.bearing import Bearing
from twingap.config import build, read_toml
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code
from twingap.records import RecordSet
from twingap.signal.envelope import lines_at, squared_envelope_spectrum
from twingap.signal.spectrum import Spectrum
from twingap.sweep import sweep

if TYPE_CHECKING:
    from twingap.track import Run

Array = NDArray[np.float64]
CONFIG: Final = Path(__file__).with_name("lines.toml")
RIG: Final = "virtual_cwru"
FAULTS: Final = ("inner", "outer", "ball")
ONLY: Final = "one"
"""Name of the sensor where there is one alone."""
ANY: Final = "any"


@dataclass(frozen=True)
class Size:
    """How much is run; explained in lines.toml."""

    noises: int
    rig_duration_s: float
    smoke: bool


@dataclass(frozen=True)
class Options:
    """The study; every entry is explained in lines.toml."""

    data: tuple[str, ...]
    bands: tuple[tuple[float, float], ...]
    harmonics: int
    tolerance: float
    false_alarm: float
    sensors: dict[str, tuple[str, ...]]
    profiles: dict[str, Size]


@dataclass(frozen=True)
class Reading:
    """How lines are read: all that prominences depend on but the recording.

    Parameters
    ----------
    bands : tuple of (float, float)
        Demodulated, of the sampling rate.
    harmonics : int
    tolerance : float
        Of a line's order.
    """

    bands: tuple[tuple[float, float], ...]
    harmonics: int
    tolerance: float


@dataclass(frozen=True)
class Limit:
    """White noise like a recording: its length, rate, shaft and bearing, and how often a limit may be passed."""

    samples: int
    fs_hz: float
    turn_hz: float
    bearing: Bearing
    reading: Reading
    noises: int
    false_alarm: float


@dataclass(frozen=True)
class Study:
    """What came out.

    Parameters
    ----------
    tables : dict of str to DataFrame
        lines-told (by data set, sensor and class), lines-recordings.
    title : str
        Where the records come from.
    """

    tables: dict[str, pd.DataFrame]
    title: str


def prominences(x: Array, fs_hz: float, turn_hz: float, bearing: Bearing, reading: Reading) -> Array:
    """How far the line of each fault stands out in the squared-envelope spectrum of each band.

    Parameters
    ----------
    x : Array [samples]
    fs_hz, turn_hz : float
        Sampling rate and rate of the shaft, Hz.
    bearing : Bearing
    reading : Reading

    Returns
    -------
    Array [bands, faults]
        Over the spectrum's median around it; geometric mean over harmonics.
    """
    rows = []
    for low, high in reading.bands:
        hz, values = squared_envelope_spectrum(x, fs_hz, (low * fs_hz, high * fs_hz), window="hann")
        over = Spectrum(hz / turn_hz, values)
        each = [
            lines_at(over, bearing.fault_order(fault), harmonics=reading.harmonics, tolerance=reading.tolerance)
            for fault in FAULTS
        ]
        rows.append([float(np.exp(np.log(lines.prominence).mean())) for lines in each])
    return np.array(rows)


def limit_of(noise: Limit) -> float:
    """What the most prominent line of white noise, over bands and faults, stays below but for the false alarms."""
    rng = np.random.default_rng(noise.samples)
    largest = [
        prominences(rng.standard_normal(noise.samples), noise.fs_hz, noise.turn_hz, noise.bearing, noise.reading).max()
        for _ in range(noise.noises)
    ]
    return float(np.quantile(largest, 1 - noise.false_alarm))


def read(records: RecordSet, sensor: str, options: Options, limits: Mapping[str, float]) -> pd.DataFrame:
    """A row for each faulty recording of a sensor."""
    reading, bearing, rows = _reading(options), _bearing(records), []
    for record in records:
        about = record.condition
        if about.fault not in FAULTS:
            continue
        found = prominences(record.samples, about.fs_hz, about.speed_rpm / 60, bearing, reading)
        own, largest = FAULTS.index(about.fault), found.max(axis=0)
        rows.append({
            "recording": about.group or about.name, "bearing": about.extra.get("bearing_id", ""),
            "speed_rpm": about.speed_rpm, "class": about.fault, "sensor": sensor,
            **dict(zip(FAULTS, largest, strict=True)), "limit": limits[about.name],
            "bands where the own line is the highest": int((found.argmax(axis=1) == own).sum()),
            "highest": FAULTS[int(largest.argmax())],
        })  # fmt: skip
    return pd.DataFrame(rows)


def told(rows: pd.DataFrame) -> pd.DataFrame:
    """By data set, sensor and class: recordings whose own line passes noise, and those where no other stands higher.

    The sensor "any" takes a recording's sensors together: lines of the highest of all of them.
    """
    own = rows.assign(own=[row[row["class"]] for _, row in rows.iterrows()])
    each = own.groupby(["data", "recording"], sort=False)["own"].transform("idxmax")
    together = own.loc[each.drop_duplicates()].assign(sensor=ANY)
    best = rows.groupby(["data", "recording"], sort=False)[list(FAULTS)].max()
    together["highest"] = [best.loc[(r["data"], r["recording"])].idxmax() for _, r in together.iterrows()]
    several = rows.groupby("data")["sensor"].nunique()
    together = together[together["data"].map(several) > 1]
    found = []
    for (data, sensor, fault), part in pd.concat([own, together]).groupby(["data", "sensor", "class"], sort=False):
        above = part["own"] > part["limit"]
        found.append({
            "data": data, "sensor": sensor, "class": fault, "recordings": len(part),
            "own line above noise": above.sum(),
            "and no other higher": (above & (part["highest"] == fault)).sum(),
            "another higher": (part["highest"] != fault).sum(),
        })  # fmt: skip
    return pd.DataFrame(found)


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> Study:
    """Read every recording's lines.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/`` and ``results/``, where limits of noise are kept.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without records the virtual rig is taken, and every table says so.
    seed, draw
        Taken as by every study of the paper; nothing is drawn by lot but noise, and there is no figure.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables go there as well.
    progress : callable
    config : Path

    Returns
    -------
    Study

    Raises
    ------
    TwingapError
        For a configuration, profile, backend or folder that cannot be used, or records that cannot be read.
    """
    options = build(Options, read_toml(config), config)
    size = profile_of(options.profiles, profile, config)
    sets = _load(options, size, root)
    noises = {(name, sensor): _noises(records, options, size) for (name, sensor), records in sets.items()}
    asked = list(dict.fromkeys(noise for of_set in noises.values() for noise in of_set.values()))
    found = sweep(
        limit_of, asked, version=digest_of_code(twingap.signal, sys.modules[__name__]), store=out / "results",
        on_result=Count("limits of noise", len(asked), progress), backend=backend, address=address,
        describe=lambda noise: f"white noise of {noise.samples} samples",
    )  # fmt: skip
    known = {result.job: float(result.value) for result in found}
    parts = []
    for done, ((name, sensor), records) in enumerate(sets.items(), 1):
        limits = {recording: known[noise] for recording, noise in noises[name, sensor].items()}
        parts.append(read(records, sensor, options, limits).assign(data=TITLES[name]))
        progress("sensors read", done, len(sets))
    rows = pd.concat(parts, ignore_index=True)
    rows.insert(0, "data", rows.pop("data"))
    title = ", ".join(dict.fromkeys(TITLES[name] for name, _ in sets))
    tables = {"lines-told": told(rows), "lines-recordings": rows}
    keep_tables(tables, out, log, title)
    return Study(tables, title)


def _load(options: Options, size: Size, root: Path | None) -> dict[tuple[str, str], RecordSet]:
    sets: dict[tuple[str, str], RecordSet] = {}
    for name in options.data[:1] if size.smoke else options.data:
        sensors = options.sensors.get(name, (ONLY,))
        for sensor in sensors[:1] if size.smoke else sensors:
            channel = {} if sensor == ONLY else {"channel": sensor}
            try:
                sets[name, sensor] = datasets.load(name, root, fs_hz=RATE_HZ[name], **channel)
            except TwingapError:
                if root is not None:
                    raise
                break  # not at hand
    return sets or {(RIG, ONLY): datasets.load(RIG, duration_s=size.rig_duration_s)}


def _noises(records: RecordSet, options: Options, size: Size) -> dict[str, Limit]:
    """Recording -> the noise that it is held against; lengths and shafts that hardly differ share one."""
    reading, bearing = _reading(options), _bearing(records)

    @functools.cache
    def noise(samples: int, fs_hz: float, turn_hz: float) -> Limit:
        return Limit(samples, fs_hz, turn_hz, bearing, reading, size.noises, options.false_alarm)

    return {
        c.name: noise(int(_roughly(c.n_samples)), c.fs_hz, _roughly(c.speed_rpm / 60))
        for c in records.conditions
        if c.fault in FAULTS
    }


def _roughly(value: float) -> float:
    """One digit of it."""
    return float(f"{value:.0e}")


def _reading(options: Options) -> Reading:
    return Reading(options.bands, options.harmonics, options.tolerance)


def _bearing(records: RecordSet) -> Bearing:
    if records.bearing is None:
        raise TwingapError(f"{records.name} names no bearing, and so no order of a fault")
    return records.bearing


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""

    def shown(study: Study) -> dict[str, Any]:
        return {f"{name} ({study.title})": table for name, table in study.tables.items()}

    command(run, "Which recordings show the line of their own fault.", shown, arguments, takes=("root", "seed"))


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper2_digital_twin.lines import main as run_main

    run_main()
