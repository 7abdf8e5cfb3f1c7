"""Jobs of the availability study, each run anywhere and kept: network, shallow methods, alarm, false-alarm check.

Network: twin images -> train -> choose without labels -> judge with no label -> correct with n, by a head -> judge
Shallow: n labelled records -> SVM, maps by class -> judge
Alarm:   healthy windows -> map, threshold -> MQE and alarm of every recording
Check:   simulated healthy machines -> map, threshold -> share of false alarms in recordings never seen

Used in: Paper 2, diagnosis by how much fault data there is.
"""

import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.framework import Inputs, Work
from papers.options import expect, read
from papers.paper2_digital_twin.availability import records, source
from papers.paper2_digital_twin.availability.records import ALL, SPLITS, TITLES, Measured
from papers.paper2_digital_twin.availability.source import Background, Kind, Plant, SourceOptions
from papers.paper2_digital_twin.methods.condition_features import window_features
from papers.paper2_digital_twin.methods.few_labels import fit_few_labels
from papers.paper2_digital_twin.methods.inception import InceptionTraining, evidence, outputs, train_inception
from papers.paper2_digital_twin.methods.residual_head import HeadOptions, fit_residual_head
from papers.paper2_digital_twin.methods.scalograms import ImageOptions, Images, Modulation, images, pieces_of
from papers.paper2_digital_twin.methods.severity import MapOptions, fit_class_maps, healthy_map
from twingap import RecordSet, TwingapError
from twingap.adapt import CRITERIA, Evidence, Outputs, select
from twingap.provenance import digest_of_value

CONFIG: Final = Path(__file__).with_name("config.toml")
Places = NDArray[np.int64]
HELD_OUT: Final = 5  # every fifth virtual machine is kept from training
STRIP: Final = 6  # pieces that are judged together by the network
TINY: Final = 1e-6


@dataclass(frozen=True)
class Size:
    seeds: int
    machines: int
    ablation_seeds: int
    steps: int
    check_machines: int
    rig_duration_s: float
    smoke: bool


@dataclass(frozen=True)
class Options:
    data: tuple[str, ...]
    counts: tuple[int, ...]
    folds: int
    false_alarm: float
    criterion: str
    ablation: tuple[Kind, ...]
    image: ImageOptions
    map: MapOptions
    source: SourceOptions
    training: InceptionTraining
    head: HeadOptions
    profiles: dict[str, Size]

    def __post_init__(self) -> None:
        expect(self.criterion, CRITERIA, "criterion")
        for name in self.data:
            expect(name, TITLES, "data")
        if self.folds < 2 or any(count < 1 for count in self.counts):
            raise TwingapError("two folds or more and counts of 1 or more expected")
        if self.head.length <= 0 or self.head.variance <= 0 or self.head.trust < 0:
            raise TwingapError("length and variance above 0, trust of 0 or more expected", where="head")
        if max(self.source.pooled) != self.source.pooled[-1]:
            raise TwingapError(f"source.pooled = {list(self.source.pooled)}, rising numbers expected")


def read_options(path: Path = CONFIG) -> Options:
    """The study's configuration, for studies that share it."""
    return read(Options, path)


@dataclass(frozen=True)
class NetworkJob:
    """One training, and all heads on it."""

    data: str
    kind: str
    fold: int
    folds: int
    seed: int
    counts: tuple[int, ...]
    criterion: str
    training: InceptionTraining
    head: HeadOptions
    image: ImageOptions


@dataclass(frozen=True)
class ShallowJob:
    """SVM and maps by class, all numbers of labels."""

    data: str
    fold: int
    folds: int
    seed: int
    counts: tuple[int, ...]
    maps: MapOptions


@dataclass(frozen=True)
class AlarmJob:
    """Healthy map and alarm of a data set; `without` names a healthy recording that is kept from it."""

    data: str
    without: str
    seed: int
    false_alarm: float
    maps: MapOptions


@dataclass(frozen=True)
class CheckJob:
    """False alarms of one simulated machine."""

    plant: Plant
    recordings: int
    seconds: float
    seed: int
    false_alarm: float
    maps: MapOptions


def baseline_of(data: Measured, judge: Sequence[str]) -> Array:
    """Healthy level of the carriers, from healthy recordings that are not judged."""
    return data.baseline([h for h in data.healthy() if h not in judge])


def strips(data: Measured, recording: str, baseline: Array, image: ImageOptions, size: int) -> Images:
    """A recording as images of up to `size` consecutive pieces each."""
    parts = _parts(data.pieces([recording]), size)
    found = [Modulation(data.found.lines[p], data.found.power[p]).pooled() for p in parts]
    whole = Modulation(np.concatenate([f.lines for f in found]), np.concatenate([f.power for f in found]))
    return images(whole, baseline, image)


def _parts(places: Places, size: int) -> list[Places]:
    """Consecutive pieces in strips of up to about `size`."""
    return np.array_split(places, max(1, round(len(places) / size)))


def network(job: NetworkJob, data: Mapping[str, Measured], source: Mapping[str, Any]) -> dict[str, Any]:
    """Train on the twin's images (`source`: by ``data kind fold``) without a label, choose and judge; then correct it
    by few labels, and judge. ``split`` -> ``rows`` -> ``count`` -> recording -> called class; what each checkpoint says
    and scores; and what the same head calls without the network."""
    own, made = data[job.data], source[f"{job.data} {job.kind} {job.fold}"]
    n_classes, truth = len(own.classes), own.piece_labels()
    x, y = np.asarray(made["images"], dtype=np.float32), np.asarray(made["labels"], dtype=np.int64)
    held = np.asarray(made["machine"]) % HELD_OUT == job.seed % HELD_OUT
    states = train_inception(x[~held], y[~held], n_classes, job.training, job.seed)
    out: dict[str, Any] = {}
    # Healthy recordings are dealt alike in all splits, and with them the baseline.
    baseline = baseline_of(own, records.judged(own, SPLITS[0], job.fold, job.folds, job.seed))
    target = {r: strips(own, r, baseline, job.image, STRIP) for r in own.recordings}
    each = {r: np.stack([own.features[p].mean(axis=0) for p in _parts(own.pieces([r]), STRIP)]) for r in own.recordings}
    owner = np.concatenate([[r] * len(v) for r, v in target.items()])
    shown, features = np.concatenate(list(target.values())), np.concatenate(list(each.values()))
    alone = images(own.found, baseline, job.image)
    seen = evidence(states, x[held], y[held], shown, n_classes, job.training)
    for split in SPLITS:
        judge = records.judged(own, split, job.fold, job.folds, job.seed)
        learn = [r for r in own.recordings if r not in judge]
        known = np.isin(owner, learn)
        # The choice looks at the recordings that may be learnt from, without their labels, never at those judged.
        choosing = [
            Evidence(e.source, e.source_labels, Outputs(e.target.logits[known], e.target.features[known])) for e in seen
        ]
        place = select(choosing, job.criterion)
        calls = [_calls(e.target.probabilities, owner, judge) for e in seen]
        rows: dict[str, Any] = {"0": {"calls": calls[place], "labels": 0}}
        out[split] = {
            "rows": rows,
            "checkpoint": place,
            "by criterion": {name: calls[select(choosing, name)] for name in CRITERIA},
            "checkpoints": calls,
            "scores": {name: [float(score(e)) for e in choosing] for name, score in CRITERIA.items()},
        }
        asked, unlabelled = np.isin(owner, judge), own.features[own.pieces(learn)]
        pieces = outputs(states[place], alone, n_classes, job.training).logits.astype(np.float64)
        logits = seen[place].target.logits.astype(np.float64)
        for count in job.counts:
            rng = np.random.default_rng([job.seed, 31, job.fold, SPLITS.index(split)])
            few = records.labelled(own, learn, count, rng, all_healthy=True)
            row: dict[str, Any] = {"labels": records.counts_of(own, few)}
            for name, options in (("calls", job.head), ("without network", dataclasses.replace(job.head, trust=0.0))):
                head = fit_residual_head(pieces[few], own.features[few], truth[few], unlabelled, options)
                told = head.probabilities(logits[asked], features[asked])
                row[name] = _calls(told, owner[asked], judge)
            rows[str(count)] = row
    return out


def shallow(job: ShallowJob, data: Mapping[str, Measured]) -> dict[str, Any]:
    """SVM and maps by class on the features of labelled records; ``split`` -> method -> ``count`` -> calls."""
    own = data[job.data]
    n_classes, truth = len(own.classes), own.piece_labels()
    out: dict[str, Any] = {}
    for split in SPLITS:
        judge = records.judged(own, split, job.fold, job.folds, job.seed)
        learn = [r for r in own.recordings if r not in judge]
        asked = own.pieces(judge)
        out[split] = {"SVM": {}, "SOM-MQE": {}}
        for count in job.counts:
            rng = np.random.default_rng([job.seed, 31, job.fold, SPLITS.index(split)])
            places = records.labelled(own, learn, count, rng, all_healthy=False)
            f, y = own.features[places], truth[places]
            svm = fit_few_labels(f, y, own.recording[places], n_classes)
            maps = fit_class_maps(f, y, n_classes, job.maps, rng)
            for name, made in (("SVM", svm), ("SOM-MQE", maps)):
                called = _calls(made.probabilities(own.features[asked]), own.recording[asked], judge)
                out[split][name][str(count)] = {"calls": called, "labels": records.counts_of(own, places)}
    return out


def alarm(job: AlarmJob, data: Mapping[str, Measured]) -> dict[str, Any]:
    """Healthy map of all healthy recordings but one; MQE and alarms of every recording. One alarms when more than half
    of its windows do: by Markov's inequality a healthy one does with a probability of at most 2 `false_alarm`."""
    own = data[job.data]
    healthy = [h for h in own.healthy() if h != job.without]
    inside = np.isin(own.window_recording, healthy)
    made = healthy_map(
        own.windows[inside], own.window_recording[inside], job.false_alarm, np.random.default_rng(job.seed), job.maps
    )
    rows = {}
    for r in own.recordings:
        mqe = made.mqe(own.windows[own.window_recording == r])
        share = float((mqe > made.threshold).mean())
        rows[r] = {
            "mqe": float(np.median(mqe)), "mqe low": float(np.quantile(mqe, 0.1)),
            "mqe high": float(np.quantile(mqe, 0.9)), "share": share, "alarm": share > 0.5,
        }  # fmt: skip
    held = {h: float((made.held_out[own.window_recording[inside] == h] > made.threshold).mean()) for h in healthy}
    return {"threshold": made.threshold, "healthy windows": int(inside.sum()), "recordings": rows, "held out": held}


def false_alarms(job: CheckJob) -> dict[str, Any]:
    """A simulated healthy machine: three recordings calibrate, the others are judged."""
    made = source.healthy_recordings(job.plant, job.seed, job.recordings, job.seconds)
    each = [window_features(pieces_of(x, records.WINDOW), np.median) for x in made]
    group = np.concatenate([[f"r{i}"] * len(f) for i, f in enumerate(each[:3])])
    own = healthy_map(np.concatenate(each[:3]), group, job.false_alarm, np.random.default_rng(job.seed), job.maps)
    shares = [float((own.mqe(f) > own.threshold).mean()) for f in each[3:]]
    return {"windows": sum(map(len, each[3:])), "share": float(np.mean(shares)), "alarms": sum(s > 0.5 for s in shares),
            "recordings": len(shares)}  # fmt: skip


def _calls(probabilities: Array, owner: NDArray[np.str_], judge: Sequence[str]) -> dict[str, int]:
    """What each recording is called: largest mean log probability over its pieces or strips."""
    sure = np.log(np.maximum(probabilities, TINY))
    return {r: int(sure[owner == r].mean(axis=0).argmax()) for r in judge}


def load_sets(work: Work) -> dict[str, RecordSet]:
    """Those of the data sets that are at hand; the virtual rig when none is."""
    options, size = work.options, work.size
    found = records.at_hand(options.data[:1] if size.smoke else options.data, work.root, size.rig_duration_s)
    work.title = ", ".join(TITLES[name] for name in found)
    return found


def healthy(work: Work) -> dict[str, dict[str, Background]]:
    """Each set's recordings that a twin may stand on."""
    image = work.options.image
    return {name: records.backgrounds(found, work["data"][name], image) for name, found in work["records"].items()}


def folds(work: Work) -> range:
    return range(1 if work.size.smoke else work.options.folds)


def kinds(work: Work) -> dict[Kind, int]:
    """Sources and the number of their seeds; those without are left out."""
    options, size = work.options, work.size
    found: dict[Kind, int] = {"grafted": size.seeds, **dict.fromkeys(options.ablation, size.ablation_seeds)}
    return {kind: count for kind, count in found.items() if count}


def plants(work: Work) -> dict[str, Plant]:
    options, machines, healthy = work.options, work.size.machines, work["healthy"]
    return {
        f"{name} {kind} {fold}": _plant(options, own, kind, fold, machines, tuple(healthy[name]), work.seed)
        for (name, own), kind, fold in itertools.product(work["data"].items(), kinds(work), folds(work))
    }


def shallows(work: Work) -> Iterator[ShallowJob]:
    options = work.options
    seeds = range(work.seed, work.seed + work.size.seeds)
    for name, seed, fold in itertools.product(work["data"], seeds, folds(work)):
        yield ShallowJob(name, fold, options.folds, seed, (*options.counts, ALL), options.map)


def alarms(work: Work) -> Iterator[AlarmJob]:
    """Alarms by set, healthy recording kept from the map, and seed."""
    seeds = range(work.seed, work.seed + work.size.seeds)
    for name, own in work["data"].items():
        for without, seed in itertools.product(("", *own.healthy()), seeds):
            yield AlarmJob(name, without, seed, work.options.false_alarm, work.options.map)


def checks(work: Work) -> Iterator[CheckJob]:
    """Simulated healthy machines on which false alarms are counted."""
    options = work.options
    plant = _plant(options, next(iter(work["data"].values())), "effects", 0, 1, (), work.seed)
    for seed in range(work.size.check_machines):
        yield CheckJob(plant, 15, 4.0, seed, options.false_alarm, options.map)


def networks(work: Work) -> Iterator[NetworkJob]:
    """Trainings, seed by seed, so that what an interrupted run has finished is whole for the seeds that it has."""
    options = work.options
    training = dataclasses.replace(options.training, steps=work.size.steps)
    for kind, count in kinds(work).items():
        seeds, counts = range(work.seed, work.seed + count), (*options.counts, ALL) if kind == "grafted" else ()
        for seed, name, fold in itertools.product(seeds, work["data"], folds(work)):
            yield NetworkJob(
                name, kind, fold, options.folds, seed, counts, options.criterion, training, options.head, options.image
            )


def of_data(work: Work) -> Inputs:
    """All sets, cut into pieces; the digest is of the records."""
    return {"data": (work["data"], digest_of_value({name: own.digest for name, own in work["records"].items()}))}


def simulated(work: Work) -> dict[str, Any]:
    """Images of every population, by its name; one set's healthy recordings travel to a worker at a time."""
    wanted = work["plants"]
    made: dict[Plant, Any] = {}
    for name in work["data"]:
        here = list(dict.fromkeys(p for p in wanted.values() if p.data == name))
        inputs = {"healthy": (work["healthy"][name], work["records"][name].digest)}
        made |= {r.job: r.value for r in work.sweep(source.simulate, here, inputs, what="populations")}
    return {key: made[plant] for key, plant in wanted.items()}


def of_both(work: Work) -> Inputs:
    """Real sets, and what the twins made."""
    digest = digest_of_value({key: digest_of_value(plant) for key, plant in work["plants"].items()})
    return {**of_data(work), "source": (work["source"], digest)}


def _plant(
    options: Options, data: Measured, kind: Kind, fold: int, machines: int, backgrounds: tuple[str, ...], seed: int
) -> Plant:
    """The population of a fold; those that stand on no measured record are the same for all folds."""
    under: tuple[str, ...] = ()
    if kind == "grafted":
        # Healthy recordings are dealt alike in every seed and split.
        own = records.judged(data, SPLITS[0], fold, options.folds, seed)
        under = tuple(b for b in backgrounds if b not in own)
        if not under:
            raise TwingapError("no healthy recording is left to learn from", where=f"{data.name}, fold {fold}")
    speeds = tuple(sorted({round(s, 1) for s in data.speeds_rpm.values()}))
    return Plant(
        kind, data.name, under, data.classes, speeds, data.fs_hz, data.bearing, machines, options.source, options.image,
        seed,
    )  # fmt: skip
