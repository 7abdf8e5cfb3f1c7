"""Runs to failure as features along running time: IMS from raw snapshots or feature tables, FEMTO raw, or simulated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from papers.arrays import Array
from twingap import BEARINGS, Condition, RecordSet, TwingapError, data
from twingap.data.ims import ims_features
from twingap.prognosis.health_indicator import Run, features_of, running
from twingap.signal import PAPER2_FEATURES, spectral_kurtosis
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin, paper1_chain

Swept = Callable[[Callable[..., Any], Sequence[Any], Any], Sequence[Any]]
"""(function, jobs, inputs) -> results; see `papers.framework.Work.sweep`."""

TIME_COLUMNS: Final = {
    "mean": "mean", "std": "std", "skewness": "skew", "kurtosis": "kurt", "max": "max", "rms": "rms",
    "crest_factor": "crest_factor", "shape_factor": "shape_factor", "impulse_factor": "impulse_factor",
    "clearance_factor": "clearance_factor", "energy": "energy",
}  # fmt: skip
"""Feature -> column of the IMS tables. Their maximum is there where `paper2_features` has peak to peak; their kurtosis
is the excess, to which 3 is added."""
STAND_INS: Final = ("spectral_entropy", "high_freq_ratio", "psd_std", "env_kurtosis")
"""What the tables have of the spectrum, in place of the four of spectral kurtosis, which they lack. Not those."""
SURROGATES: Final = " (surrogates for spectral kurtosis)"  # said wherever runs with such stand-ins are named
IMS_SAMPLES: Final = 20_480
SHOWN_COLUMNS: Final = 300  # columns of the map of spectral kurtosis kept for the figure


@dataclass(frozen=True)
class StudyRun:
    run: Run  # time is running time, s; silent records (machine stopped, sensor off) are left out
    whole: Run  # with them
    source: str  # "raw records", "feature table" or "simulated"
    family: str  # runs of one family set limits for, and choose indicators for, each other
    healthy_rows: int
    trend_rows: int
    stand_ins: tuple[str, ...] = ()  # features in place of those of the spectral kurtosis
    extremes: Array | None = None  # [rows, 2] least and greatest sample of each record, for the figure of the waveform
    # time [columns], frequency [lines], spectral kurtosis [columns, lines]
    kurtosis_map: tuple[Array, Array, Array] | None = None

    @property
    def name(self) -> str:
        return self.run.name


@dataclass(frozen=True)
class Measure:
    """Features of one bearing's records."""

    data: str
    bearing: str
    window_samples: int


def measure(job: Measure, records: RecordSet) -> dict[str, Any]:
    """Features of the records of a bearing, in order of time, and what the figures show of them."""
    own = records.select(lambda c: c.group == job.bearing)
    run = features_of(own, job.bearing, window_samples=job.window_samples)
    order = np.argsort([float(c.time_s or 0.0) for c in own.conditions], kind="stable")
    per_column = -(-len(own) // SHOWN_COLUMNS)
    extremes, columns, ends = [], [], []
    for begin in range(0, len(own), per_column):
        held = []
        for at in order[begin : begin + per_column]:
            record = own[int(at)]
            extremes.append((record.samples.min(), record.samples.max()))
            held.append(
                spectral_kurtosis(record.samples, record.condition.fs_hz, window_samples=job.window_samples)
            )  # fmt: skip
        columns.append(np.mean([sk.values for sk in held], axis=0))
        ends.append(min(begin + per_column, len(own)) - 1)
    return {
        "time_s": run.time_s, "features": run.features, "extremes": np.array(extremes, np.float32),
        "frequency_hz": held[-1].frequency, "kurtosis_time_s": run.time_s[ends],
        "kurtosis": np.array(columns, np.float32),
    }  # fmt: skip


@dataclass(frozen=True)
class Reading:
    """How runs are read; explained in config.toml."""

    healthy_rows_ims: int
    healthy_rows_femto: int
    trend_rows_ims: int
    trend_rows_femto: int
    silent_share: float
    window_samples: int

    def study_run(self, whole: Run, source: str, family: str, *more: Any) -> StudyRun:
        """A run of a family with its silent records told apart; `more` are the last entries of `StudyRun`."""
        ims = family == "IMS"
        healthy = self.healthy_rows_ims if ims else self.healthy_rows_femto
        keep = running(whole, healthy, self.silent_share)
        turning = Run(whole.name, whole.time_s[keep], whole.names, whole.features[keep])
        trend = self.trend_rows_ims if ims else self.trend_rows_femto
        return StudyRun(turning, whole, source, family, healthy, trend, *more)


def study_runs(
    ims: Sequence[str], femto: Sequence[str], reading: Reading, root: Path | None, swept: Swept
) -> tuple[str, list[StudyRun]]:
    """All runs at hand, and where they come from; four simulated runs when there are none and the caller named no
    root."""
    found: list[StudyRun] = []
    missing: list[str] = []
    for name in ims:
        try:
            found.append(_ims_run(name, reading, root, swept))
        except data.NotAtHandError as error:
            missing.append(str(error))
    try:
        records = data.load("femto", root)
    except data.NotAtHandError as error:
        missing.append(str(error))
    else:
        found += _measured(records, [name for name in femto if name in records.groups], "FEMTO", reading, swept)
    if found:
        families = dict.fromkeys(
            r.family + (SURROGATES if any(o.stand_ins for o in found if o.family == r.family) else "") for r in found
        )
        return " and ".join(families), found
    if root is not None and missing:  # who names data wants those used
        raise TwingapError(f"no run to failure is at hand: {missing[0]}", where=root)
    simulated = simulated_runs()
    found = _measured(simulated, simulated.groups, "simulated", reading, swept)
    return "simulated runs, neither IMS nor FEMTO", found


def simulated_runs(count: int = 4, records: int = 150) -> RecordSet:
    """Runs made by the phenomenological twin, impacts growing exponentially from the middle of life on (eq. 12 of
    paper 1): to try the chain on, no evidence for or against any curve."""
    bearing = BEARINGS["PRONOSTIA"]
    made = []
    for number in range(count):
        rng = np.random.default_rng([number, 17])
        life = 10.0 * (records - 1)
        chain = paper1_chain(rate_per_s=float(rng.uniform(3, 5)) / life, onset_s=0.4 * life, reference_speed_rpm=1800.0)
        levels = PhenomenologicalParameters(impact_amplitude={"outer": 0.3})
        group = f"run {number + 1}"
        conditions = [
            Condition(f"run{number + 1}_{k:03d}", 1800.0, 25600.0, 2560, "outer", time_s=10.0 * k, group=group)
            for k in range(records)
        ]
        made += list(PhenomenologicalTwin(bearing, levels, chain, unit="g").simulate(conditions, rng))
    return RecordSet.from_records("simulated runs", "g", bearing, made)


def running_time(time_s: Array) -> Array:
    """Clock without pauses [rows], s: an interval of more than three times the median counts as the median (IMS test 1
    stood still for six days in all)."""
    steps = np.diff(time_s)
    if steps.size == 0:
        return np.zeros(time_s.size)
    usual = float(np.median(steps))
    return np.concatenate([[0.0], np.cumsum(np.where(steps > 3 * usual, usual, steps))])


def table_features(part: pd.DataFrame) -> tuple[tuple[str, ...], Array, tuple[str, ...]]:
    """What the IMS tables have of the 15 features: names, values [rows, features], and which are stand-ins."""
    columns = {name: part[column].to_numpy(float) for name, column in TIME_COLUMNS.items() if column in part}
    columns["kurtosis"] = columns["kurtosis"] + 3
    # Test 3 lacks the second table; what follows from the first is computed.
    columns.setdefault("crest_factor", columns["max"] / columns["rms"])
    columns.setdefault("energy", columns["rms"] ** 2 * IMS_SAMPLES)
    there = tuple(name for name in STAND_INS if name in part)
    columns |= {name: part[name].to_numpy(float) for name in there}
    return tuple(columns), np.stack(list(columns.values()), axis=-1), there


def _ims_run(name: str, reading: Reading, root: Path | None, swept: Swept) -> StudyRun:
    """One bearing of one IMS test: from raw snapshots when they are there, else from the tables."""
    test, bearing = (int(word) for word in name.split(" bearing "))
    title = f"IMS {name}"
    try:
        records = data.load("ims", root, test=test).select(
            lambda c: c.extra["bearing"] == bearing and c.extra["accelerometer"] == 1
        )
    except data.NotAtHandError:
        records = None
    if records is not None and len(records):
        (found,) = _measured(records, records.groups, "IMS", reading, swept)
        return replace(found, run=replace(found.run, name=title), whole=replace(found.whole, name=title))
    table = ims_features(root, test=test)
    part = table[(table["bearing"] == bearing) & (table["accelerometer"] == 1)]
    if part.empty:
        raise TwingapError(f"no bearing {bearing} in test {test}", where="IMS feature table")
    names, values, stand_ins = table_features(part)
    whole = Run(title, running_time(part["time_s"].to_numpy(float)), names, values)
    source = "feature table" + (SURROGATES if stand_ins else "")
    return reading.study_run(whole, source, "IMS", stand_ins)


def _measured(
    records: RecordSet, bearings: Sequence[str], family: str, reading: Reading, swept: Swept
) -> list[StudyRun]:
    """Features by jobs, one a bearing."""
    jobs = [Measure(records.name, bearing, reading.window_samples) for bearing in bearings]
    source, found = "simulated" if family == "simulated" else "raw records", []
    for result in swept(measure, jobs, {"records": (records, records.digest)}) if jobs else ():
        value = {key: np.asarray(part, float) for key, part in result.value.items()}
        time_s = running_time(value["time_s"])
        whole = Run(f"{family} {result.job.bearing}", time_s, PAPER2_FEATURES, value["features"])
        shown = value["kurtosis_time_s"], value["frequency_hz"], value["kurtosis"]
        found.append(reading.study_run(whole, source, family, (), value["extremes"], shown))
    return found
