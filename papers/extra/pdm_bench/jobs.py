"""The frozen scenarios of pdm-bench: real recordings that teach, recordings that are judged, simulated fleets beside.

record set --queries of a scenario--> recordings that teach | recordings that are judged
each recording --windows--> indicators (11, as pdm-bench's) | order features
real labels | simulated fleets --forest, or adaptation to judged rows without labels--> judge

Methods, settings and label-free choice are those of the study of baselines. Adaptations see the judged windows without
labels; the forest and "No adaptation" are fitted without them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from papers.arrays import Array
from papers.extra.baselines.adaptation import PLAIN, SETTINGS, Labels, chosen, scores
from papers.framework import Result, Work
from papers.options import expect
from twingap import Condition, RecordSet, TwingapError
from twingap import data as datasets
from twingap.adapt import CRITERIA, Fleets, Population, Windows
from twingap.adapt.order_features import names, order_features
from twingap.adapt.order_forest import MOST_MEMBERS, examples
from twingap.bearing import FAULTS, Bearing
from twingap.provenance import digest_of_path, digest_of_value
from twingap.signal.features import time_features
from twingap.twins.twin_file import TwinSpec

Rows = Mapping[str, NDArray[Any]]
"""Features by view [windows, features], with the ``label`` and the ``recording`` of each window."""

FOREST: Final = "Random forest"
FLEETS: Final = "simulated fleets"
SOURCES: Final = (("real labels", "indicators"), ("real labels", "orders"), (FLEETS, "orders"))
"""Who teaches, and the features."""
RIG: Final = "virtual_cwru"
TITLES: Final = {"cwru": "CWRU", "paderborn": "Paderborn", RIG: "virtual rig"}
INDICATORS: Final = (
    "rms", "std", "kurtosis", "crest_factor", "shape_factor", "clearance_factor", "impulse_factor",
)  # fmt: skip


@dataclass(frozen=True)
class Scenario:
    """Who teaches and who is judged; explained in config.toml."""

    data: str
    label: str
    train: str
    judge: str
    window: int
    overlap: float
    published: tuple[int, ...]

    def __post_init__(self) -> None:
        expect(self.data, TITLES, "data")
        if self.window < 2 or not 0 <= self.overlap < 1 or len(self.published) != 2:
            raise TwingapError("window > 1, 0 <= overlap < 1 and two published counts expected")


@dataclass(frozen=True)
class Size:
    scenarios: tuple[str, ...]
    rig_duration_s: float
    seeds: int
    most: int
    trees: int
    fleets: int


@dataclass(frozen=True)
class Options:
    criterion: str
    fleets_windows: int
    scenarios: dict[str, Scenario]
    profiles: dict[str, Size]

    def __post_init__(self) -> None:
        expect(self.criterion, CRITERIA, "criterion")
        for profile, size in self.profiles.items():
            for name in size.scenarios:
                expect(name, self.scenarios, f"profiles.{profile}.scenarios")


@dataclass(frozen=True)
class Split:
    """Places of a scenario's recordings in the record set, and the class of each as an index into `classes`."""

    name: str
    scenario: Scenario
    records: RecordSet
    train: dict[int, int]
    judge: dict[int, int]
    classes: tuple[str, ...]


@dataclass(frozen=True)
class Reading:
    """A recording, by its place in the record set, to be cut into windows."""

    data: str
    place: int
    window: int
    overlap: float
    rig_duration_s: float


@dataclass(frozen=True)
class Trial:
    """Every method on a scenario, taught by one source; fleets have the judged machine's bearing, speeds and rate."""

    scenario: str
    source: str
    view: str
    seed: int
    criterion: str
    classes: tuple[str, ...]
    bearing: Bearing
    speeds_rpm: tuple[float, ...]
    fs_hz: float
    window: int
    fleets_windows: int
    most: int
    trees: int
    fleets: int


@lru_cache(maxsize=2)
def _records(name: str, root: Path | None, rig_duration_s: float) -> RecordSet:
    return datasets.load(RIG, duration_s=rig_duration_s) if name == RIG else datasets.load(name, root)


def load_splits(work: Work) -> list[Split]:
    """The profile's scenarios, as far as their data are at hand."""
    found, missing = [], {}
    for name in work.size.scenarios:
        scenario, duration_s = work.options.scenarios[name], work.size.rig_duration_s
        try:
            records = _records(RIG if duration_s else scenario.data, work.root, duration_s)
        except datasets.NotAtHandError as error:
            missing[name] = error
            continue
        found.append(split(name, scenario, records, work.config))
    if not found:
        raise next(iter(missing.values()))
    work.missing = tuple(missing)
    work.title = ", ".join(dict.fromkeys(TITLES[own.records.name] for own in found))
    return found


def split(name: str, scenario: Scenario, records: RecordSet, path: Path) -> Split:
    """Recordings that teach and that are judged, without those shorter than a window. Raises `TwingapError` for an
    unreadable query, an empty part, a recording in both, or a class that nothing teaches."""
    where, table = f"{path}: scenarios.{name}", records.table
    table = table[table["n_samples"] >= scenario.window]
    train, judge = (_asked(table, query, where)[scenario.label] for query in (scenario.train, scenario.judge))
    classes = tuple(sorted(set(train)))
    if set(train.index) & set(judge.index) or not set(judge) <= set(classes):
        raise TwingapError("a recording teaches and is judged, or nothing teaches a class that is judged", where=where)
    first, second = (
        dict(zip(part.index.astype(int), map(classes.index, part), strict=True)) for part in (train, judge)
    )
    return Split(name, scenario, records, first, second, classes)


def _asked(table: pd.DataFrame, query: str, where: str) -> pd.DataFrame:
    try:
        found = table.query(query, engine="python")
    except Exception as error:  # pandas raises almost any error for a query that it cannot read
        raise TwingapError(f"cannot be asked: {query!r}: {error}", where=where) from error
    if found.empty:
        raise TwingapError(f"no recording at hand has {query}", where=where)
    return found


def read_rows(work: Work) -> dict[str, tuple[Rows, Rows, str]]:
    """Rows that teach and rows that are judged, and their digest, by scenario."""
    found = {}
    for own in work["splits"]:
        name, scenario = own.records.name, own.scenario
        rig = work.size.rig_duration_s
        jobs = [Reading(name, place, scenario.window, scenario.overlap, rig) for place in (*own.train, *own.judge)]
        made = work.sweep(
            read, jobs, {"root": (work.root, None)}, lambda job: f"{job.data} {job.place}, {job.window}",
            f"recordings of {own.name}", data={"files": RIG if rig else _files(datasets.data_root(work.root) / name)},
        )  # fmt: skip
        rows = {result.job.place: result.value for result in made}
        digest = digest_of_value([[result.key for result in made], list(own.train.values()), list(own.judge.values())])
        found[own.name] = (_joined(rows, own.train), _joined(rows, own.judge), digest)
    return found


_files = lru_cache(digest_of_path)


def _joined(rows: Mapping[int, Rows], places: Mapping[int, int]) -> Rows:
    counts = [len(rows[place]["orders"]) for place in places]
    views = {view: np.concatenate([rows[place][view] for place in places]).astype(float) for _, view in SOURCES}
    return views | {"label": np.repeat([*places.values()], counts), "recording": np.repeat(range(len(counts)), counts)}


def read(job: Reading, root: Path | None) -> dict[str, NDArray[np.float32]]:
    """Features of a recording's windows by view [windows, features]."""
    records = _records(job.data, root, job.rig_duration_s)
    record, bearing = records[job.place], records.bearing
    assert bearing is not None
    step = round(job.window * (1 - job.overlap))
    x = np.lib.stride_tricks.sliding_window_view(record.samples, job.window)[::step]
    about = record.condition
    fs_hz, speed_rpm = (np.full(len(x), value) for value in (about.fs_hz, about.speed_rpm))
    orders = order_features(Windows(x, fs_hz, speed_rpm, np.full(len(x), about.name)), bearing)
    return {"indicators": indicators(x, about.fs_hz).astype(np.float32), "orders": orders.astype(np.float32)}


def indicators(x: Array, fs_hz: float) -> Array:
    """The eleven indicators of pdm-bench's default configuration [windows, 11]: seven of time; mean, centre, root mean
    square (Hz) and spread about the centre of the amplitude spectrum."""
    amplitude = np.abs(np.fft.rfft(x * np.hanning(x.shape[1]), axis=1))
    f = np.fft.rfftfreq(x.shape[1], 1 / fs_hz)
    total = amplitude.sum(axis=1)
    mean, square = amplitude @ f / total, amplitude @ f**2 / total
    centre = square / mean
    spread = np.sqrt(square - 2 * centre * mean + centre**2)
    of_time = time_features(x).select(INDICATORS).values
    return np.column_stack([of_time, mean, centre, np.sqrt(square), spread])


def results(work: Work) -> Iterator[Result[Trial]]:
    for own in work["splits"]:
        train, judge, digest = work["rows"][own.name]
        yield from work.sweep(
            run_trial, list(trials(own, work)), {"train": (train, digest), "judge": (judge, digest)},
            lambda job: f"{job.scenario}, {job.source}, {job.view}, seed {job.seed}", f"scenario {own.name}",
        )  # fmt: skip


def trials(own: Split, work: Work) -> Iterator[Trial]:
    """Every source at each seed; nothing simulates a bearing that is damaged on both races."""
    judged = [own.records.conditions[place] for place in own.judge]
    speeds, size = tuple(sorted({c.speed_rpm for c in judged})), work.size
    assert own.records.bearing is not None
    for seed in range(work.seed, work.seed + size.seeds):
        for source, view in SOURCES:
            if source != FLEETS or set(own.classes) <= set(FAULTS):
                yield Trial(
                    own.name, source, view, seed, work.options.criterion, own.classes, own.records.bearing, speeds,
                    judged[0].fs_hz, own.scenario.window, work.options.fleets_windows,
                    size.most, size.trees, size.fleets,
                )  # fmt: skip


def run_trial(job: Trial, train: Rows, judge: Rows) -> dict[str, dict[str, Any]]:
    """Fit every method, choose its setting without labels of the judged part, judge: method -> `scores`, ``oracle``
    (best setting by labels), ``recordings`` (accuracy by mean probability over windows), ``setting``."""
    from sklearn.ensemble import RandomForestClassifier

    rng, target = np.random.default_rng([job.seed, 65]), judge[job.view]
    rows, labels = simulated(job) if job.source == FLEETS else (train[job.view], train["label"])
    few, near = (rng.permutation(len(part))[: job.most] for part in (rows, target))
    forest = RandomForestClassifier(job.trees, random_state=job.seed, n_jobs=1).fit(rows, labels)
    found = {FOREST: _judged([forest.predict_proba(target)], 0, judge) | {"setting": ""}}
    for method, settings in SETTINGS.items():
        own = slice(None) if method == PLAIN else few
        place, fitted = chosen(method, rows[own], labels[own], target[near], job.criterion)
        # Only from here on are labels of the judged part looked at.
        found[method] = _judged([each(target) for each in fitted], place, judge) | {"setting": str(settings[place])}
    return found


def _judged(told: Sequence[Array], place: int, judge: Rows) -> dict[str, Any]:
    truth, (recordings, first) = judge["label"], np.unique(judge["recording"], return_index=True)
    whole = np.stack([told[place][judge["recording"] == each].mean(axis=0) for each in recordings])
    return {
        **scores(told[place], truth), "oracle": max(float(np.mean(own.argmax(axis=1) == truth)) for own in told),
        "recordings": float(np.mean(whole.argmax(axis=1) == truth[first])),
    }  # fmt: skip


def simulated(job: Trial) -> tuple[Array, Labels]:
    """Order features and labels of windows of simulated fleets, of the scenario's classes alone."""
    length = 2 * job.window
    conditions = tuple(Condition(f"{speed:g}", speed, job.fs_hz, length) for speed in job.speeds_rpm)
    population = Population(TwinSpec("phenomenological"), job.bearing, "", conditions, frozenset(), length)
    known = ("healthy", *(name for name in job.classes if name != "healthy"))
    fleets, rng = Fleets(population, MOST_MEMBERS, known), np.random.default_rng([job.seed, 66])
    shown = examples(fleets, job.fleets, job.window, job.fleets_windows, rng)
    name = np.array(known)[shown.labels]
    wanted = np.isin(name, job.classes)
    labels = np.array([job.classes.index(own) for own in name[wanted]], dtype=np.int64)
    return shown.features[wanted, : len(names(job.bearing))], labels
