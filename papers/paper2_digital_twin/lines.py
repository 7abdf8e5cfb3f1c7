"""Study of recordings that show the line of their own fault, compared with recordings without the fault.

recording, sensor --five bands--> squared-envelope spectra --orders--> prominence of each fault's line, highest band
                                                                                                |
        by data set, sensor and fault: recordings with it, against healthy ones and all without it --> counts

Used in: Paper 2, section 3, diagnosis without fault data. Lines at the orders of faults stand out of healthy records
too, and an inner line out of those of outer races, so that a floor says little: what a line is worth is seen beside
recordings that lack the fault. Healthy ones are few, and other faults have lines of their own at this one's order, so
both references are given. Labels are read here: this judges recordings, and nothing learns from it. Run as part of the
paper, or alone: python -m papers.paper2_digital_twin.lines --profile full --out DIR
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from papers.paper2_digital_twin.availability_records import RATE_HZ, TITLES
from papers.studies import Progress, command, keep_tables, profile_of
from twingap import data as datasets
from twingap.bearing import Bearing
from twingap.config import build, read_toml
from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.signal.envelope import lines_at, squared_envelope_spectrum
from twingap.signal.spectrum import Spectrum

if TYPE_CHECKING:
    from twingap.track import Run

Array = NDArray[np.float64]
CONFIG: Final = Path(__file__).with_name("lines.toml")
RIG: Final = "virtual_cwru"
FAULTS: Final = ("inner", "outer", "ball")
HEALTHY: Final = "healthy"
ONLY: Final = "one"
"""Name of the sensor where there is one alone."""
ANY: Final = "at least one"
"""In place of a sensor: counts of recordings of which something holds at one of their sensors or more."""


@dataclass(frozen=True)
class Size:
    """How much is run; explained in lines.toml."""

    rig_duration_s: float
    smoke: bool


@dataclass(frozen=True)
class Options:
    """The study; every entry is explained in lines.toml."""

    data: tuple[str, ...]
    bands: tuple[tuple[float, float], ...]
    harmonics: int
    tolerance: float
    shortest_s: float
    longest_s: float
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


def read(records: RecordSet, sensor: str, options: Options) -> pd.DataFrame:
    """A row for each recording of a sensor, healthy ones too, that is long enough.

    Parameters
    ----------
    records : RecordSet
        With a bearing.
    sensor : str
        What to call it.
    options : Options

    Returns
    -------
    DataFrame
        Columns ``inner``, ``outer``, ``ball``: prominence in the band where it is highest.
    """
    if records.bearing is None:
        raise TwingapError(f"{records.name} names no bearing, and so no order of a fault")
    reading, rows = Reading(options.bands, options.harmonics, options.tolerance), []
    for i, about in enumerate(records.conditions):
        if about.fault not in (HEALTHY, *FAULTS) or about.n_samples < options.shortest_s * about.fs_hz:
            continue
        x = records[i].samples[: round(options.longest_s * about.fs_hz)]
        found = prominences(x, about.fs_hz, about.speed_rpm / 60, records.bearing, reading)
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


def told(rows: pd.DataFrame) -> pd.DataFrame:
    """By data set, sensor and class: how far the own line stands out, and out of what.

    Parameters
    ----------
    rows : DataFrame
        Of `read`, with a column ``data``.

    Returns
    -------
    DataFrame
        ``healthy, highest`` and ``without the fault, highest`` are prominences of the class's line in recordings that
        lack the fault, at the same sensor; ``above one without it`` is the share of pairs of a recording with the fault
        and one without in which the former's line stands higher (luck: 0.5). What has no healthy recording is NaN. The
        sensor "at least one" counts recordings of which a statement holds at one sensor or more, each sensor judged by
        its own references (one without healthy recordings adds nothing to ``above healthy``); it stands where there are
        several.
    """
    parts = []
    for (data, sensor, fault), own in rows[rows["class"] != HEALTHY].groupby(["data", "sensor", "class"], sort=False):
        others = rows[(rows["data"] == data) & (rows["sensor"] == sensor) & (rows["class"] != fault)]
        healthy, line = others[others["class"] == HEALTHY][fault].max(), own[fault]
        parts.append(pd.DataFrame({
            "data": data, "sensor": sensor, "class": fault, "recording": own["recording"], "line": line,
            "healthy": healthy, "without": others[fault].max(),
            "share": (line.to_numpy()[:, None] > others[fault].to_numpy()).mean(axis=1),
            "over healthy": line > healthy, "over all": line > others[fault].max(), "first": own["highest"] == fault,
        }))  # fmt: skip
    judged = pd.concat(parts, ignore_index=True)
    found = []
    for (data, sensor, fault), part in judged.groupby(["data", "sensor", "class"], sort=False):
        found.append({
            "data": data, "sensor": sensor, "class": fault, "recordings": len(part),
            "own line, lowest": part["line"].min(), "own line, highest": part["line"].max(),
            "healthy, highest": part["healthy"].max(), "without the fault, highest": part["without"].max(),
            "above healthy": np.nan if part["healthy"].isna().all() else float(part["over healthy"].sum()),
            "above all without it": part["over all"].sum(), "above one without it": part["share"].mean(),
            "highest of its recording": part["first"].sum(),
        })  # fmt: skip
    for (data, fault), part in judged.groupby(["data", "class"], sort=False):
        if part["sensor"].nunique() == 1:
            continue
        once = part.groupby("recording")[["over healthy", "over all", "first"]].any()
        found.append({
            "data": data, "sensor": ANY, "class": fault, "recordings": len(once),
            "above healthy": float(once["over healthy"].sum()), "above all without it": once["over all"].sum(),
            "highest of its recording": once["first"].sum(),
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
        Folder for ``tables/``.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without records the virtual rig is taken, and every table says so.
    seed, backend, address, draw
        Taken as by every study of the paper; nothing is drawn by lot, a minute needs no workers, there is no figure.
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
        For a configuration, profile or folder that cannot be used, or records that cannot be read.
    """
    options = build(Options, read_toml(config), config)
    size = profile_of(options.profiles, profile, config)
    sets, parts = _load(options, size, root), []
    for done, ((name, sensor), records) in enumerate(sets.items(), 1):
        parts.append(read(records, sensor, options).assign(data=TITLES[name]))
        progress("sensors read", done, len(sets))
    rows = pd.concat(parts, ignore_index=True)
    rows.insert(0, "data", rows.pop("data"))
    title = ", ".join(dict.fromkeys(TITLES[name] for name, _ in sets))
    tables = {"lines-told": told(rows), "lines-recordings": rows}
    keep_tables(tables, out, log, title)
    return Study(tables, title)


def _load(options: Options, size: Size, root: Path | None) -> dict[tuple[str, str], RecordSet]:
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


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""

    def shown(study: Study) -> dict[str, Any]:
        return {f"{name} ({study.title})": table for name, table in study.tables.items()}

    command(run, "Which recordings show the line of their own fault.", shown, arguments, takes=("root", "seed"))


if __name__ == "__main__":
    # Under its own name, which runs are tracked by.
    from papers.paper2_digital_twin.lines import main as run_main

    run_main()
