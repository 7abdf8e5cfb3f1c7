"""Shallow domain adaptation by skada, and a plain network, under the protocol of paper 3's comparison.

task --prepared--> cell: adapt (no labels) | judge; recipe
    source: contact twin | simulated fleets | population twin | real labels --> labelled windows
    windows --order_features--> rows + adapt --method, each setting--> choice of the setting --+
    windows --envelope spectra of modes--> network, each checkpoint--> choice of the checkpoint +--> judge (others)

Tasks, split, windows, identification and criterion are the comparison's; choices see no target label. Fleets have
machines with randomised values of the phenomenological twin; machines of the population twin are drawn from values that
were fitted to the recordings adapted to, without their labels (`population_twin`). "Real labels" teaches with the true
labels of those recordings: no method may do so, and it shows what the features allow at all.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.extra.baselines.adaptation import PLAIN, SETTINGS, Labels, chosen, scores
from papers.extra.baselines.population_twin import BARE, Fit, fit_population, pieces
from papers.framework import Result, Work
from papers.paper3_zoa_dann.comparison.jobs import Prepared, balanced_cells, prepared
from papers.paper3_zoa_dann.comparison.task_files import Material, split, windows_to_adapt_to
from papers.paper3_zoa_dann.comparison.trial import fleets
from papers.paper3_zoa_dann.inputs.options import read_options as read_common
from papers.paper3_zoa_dann.source import Recipe, simulate
from twingap import Bearing, Condition, RecordSet, TwingapError, classify
from twingap import simulate as simulate_twin
from twingap.adapt import ModeInputs, Training, Windows, cut, fit, joined, outputs
from twingap.adapt.order_features import order_features
from twingap.provenance import digest_of_value
from twingap.twins.population import machines
from twingap.twins.twin_file import TwinSpec

CONTACT, FLEETS, POPULATION, REAL = SOURCES = ("contact twin", "simulated fleets", "population twin", "real labels")
"""Where the labelled windows come from."""
NETWORK: Final = "Network"
"""Network of Non-DA on envelope spectra of the modes, without adaptation."""
MOST: Final = 1000  # most source windows; the transport of JDOT takes time in proportion


@dataclass(frozen=True)
class Trial:
    """Every method on a task, taught by one source; `seed` draws the source, and the network's weights and batches."""

    task: str
    unseen: float | None  # size whose bearings are left out of adaptation
    source: str  # one of `SOURCES`
    seed: int
    criterion: str  # label-free, key of `twingap.adapt.CRITERIA`
    recipe: Recipe  # of the simulated windows
    training: Training  # of the network
    inputs: ModeInputs
    held_out: float  # share of the network's source for validation


def trials(ready: Prepared, task: str, work: Work) -> Iterator[Trial]:
    """Every source at each seed of a cell."""
    options, judging = work.options, read_common().judging
    inputs = dataclasses.replace(options.inputs, quantity="envelope_spectrum")
    training = dataclasses.replace(options.training, steps=work.size.steps, vary=inputs.waveforms)
    for seed in ready.cell.seeds:
        recipe = dataclasses.replace(ready.recipe, seed=seed)
        for source in SOURCES:
            yield Trial(
                task, ready.cell.unseen, source, seed, judging.criterion, recipe, training, inputs, judging.held_out
            )


def results(work: Work) -> Iterator[tuple[str, Result[Trial]]]:
    """Every trial with the title of its data; balanced data, no noise added."""
    for task, target in work["tasks"]:
        for ready in prepared(work, task, target, balanced_cells(task, work)):
            labelled = windows_to_adapt_to(task, target.records, "balanced", ready.cell.unseen)
            twin = work["twins"][task.name, ready.cell.unseen]
            made = work.sweep(
                run_trial, trials(ready, task.name, work),
                ready.inputs | {"labelled": (labelled, None), "twin": (twin, digest_of_value(twin))},
                lambda job: f"{job.task}, {job.source}, unseen {job.unseen}, seed {job.seed}", f"task {task.name}",
            )  # fmt: skip
            yield from ((target.title, own) for own in made)


def population_twins(work: Work) -> dict[tuple[str, float | None], dict[str, Any]]:
    """Population twin of every task and size left out, fitted to the recordings adapted to, with the ``states`` that
    `twingap.classify` reads off them. The same recordings in several tasks are fitted once."""
    records: dict[str, RecordSet] = {}
    asked: dict[tuple[str, float | None], tuple[Fit, dict[str, str]]] = {}
    for task, target in work["tasks"]:
        for unseen in dict.fromkeys(cell.unseen for cell in balanced_cells(task, work)):
            recordings = split(task, target.records, unseen)[0].adapt
            own = pieces(recordings)
            states = states_without_labels(recordings, task.classes)
            job = Fit(own.digest, tuple(states[str(c.group)] for c in own.conditions), work.seed)
            asked[task.name, unseen], records[job.records] = (job, states), own
    made = work.sweep(
        # Each job names the digest of the records that it reads.
        fit_population, dict.fromkeys(job for job, _ in asked.values()), {"every": (records, "by digest")},
        lambda job: f"recordings {job.records[:8]}, states {', '.join(job.states)}", "population twins",
    )  # fmt: skip
    fitted = {own.job: own.value for own in made}
    return {cell: fitted[job] | {"states": states} for cell, (job, states) in asked.items()}


def states_without_labels(recordings: RecordSet, classes: Sequence[str]) -> dict[str, str]:
    """Most probable of the classes of each recording (group), as `twingap.classify` reads it."""
    found = classify(recordings.without_labels(), BARE)
    group = {c.name: str(c.group) for c in recordings.conditions}
    allowed = [found.classes.index(name) for name in classes]
    total: dict[str, Array] = {}
    for name, row in zip(found.names, found.probabilities, strict=True):
        total[group[name]] = total.get(group[name], 0) + row[allowed]
    return {name: classes[int(row.argmax())] for name, row in total.items()}


def run_trial(
    job: Trial, material: Material, labelled: Windows, twin: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Fit every method with each of its settings, choose the setting without target labels, judge: method -> `scores`
    of all judged windows, ``unseen`` (those of bearings not adapted to, or None) and the setting. `labelled`, the
    windows adapted to with their labels, are for the source "real labels" alone, `twin` for the population twin."""
    bearing, real = job.recipe.bearing, job.source == REAL
    source = source_windows(job, labelled, twin)
    rows, labels = _rows(source, bearing)
    target, truth = order_features(material.adapt, bearing), material.evaluate.labels
    judged, seen = order_features(material.evaluate, bearing), material.unseen
    assert truth is not None
    found: dict[str, dict[str, Any]] = {}
    for method in (PLAIN,) if real else SETTINGS:
        place, fitted = chosen(method, rows, labels, target, job.criterion)
        # Only from here on are target labels looked at.
        told = [each(judged) for each in fitted]
        found[method] = _at(place, told, truth, seen) | {"setting": str(SETTINGS[method][place])}
    net = fit(
        "Non-DA", source, material.adapt, job.seed, n_classes=len(job.recipe.classes), settings=job.training,
        inputs=job.inputs, held_out=job.held_out, criterion=job.criterion, device="cpu",
    )  # fmt: skip
    assert net.trained is not None
    shown = net.inputs(material.evaluate)
    told = [outputs(net.trained.network(place), shown).probabilities for place in range(net.checkpoints)]
    return found | {NETWORK: _at(net.place, told, truth, seen) | {"setting": f"checkpoint {net.place + 1}"}}


def _at(place: int, told: Sequence[Array], truth: Labels, seen: NDArray[np.bool_]) -> dict[str, Any]:
    def of(windows: NDArray[np.bool_]) -> dict[str, float]:
        every = [scores(probabilities[windows], truth[windows]) for probabilities in told]
        return every[place] | {"oracle": max(own["accuracy"] for own in every)}

    return of(np.ones_like(seen)) | {"unseen": of(seen) if seen.any() else None}


def source_windows(job: Trial, labelled: Windows, twin: Mapping[str, Any]) -> Windows:
    """Labelled windows of a source, at most `MOST` of simulated ones; a group has one class."""
    if job.source == REAL:
        # A class may be of one recording: windows are held out for validation.
        return dataclasses.replace(labelled, group=np.arange(len(labelled)).astype(str))
    made = _SIMULATED[job.source](job.recipe, twin)
    return made.take(np.random.default_rng([job.recipe.seed, 62]).permutation(len(made))[:MOST])


def _of_fleets(recipe: Recipe, twin: Mapping[str, Any]) -> Windows:
    rng, parts = np.random.default_rng([recipe.seed, recipe.seed, 60]), []
    for number in range(recipe.bearings_per_class):
        made = cut(fleets(recipe).fleet(number, rng), recipe.window_samples, 2, recipe.classes)
        parts.append(dataclasses.replace(made, group=np.char.add(f"{number}-", made.group)))
    return joined(parts)


def _of_population(recipe: Recipe, twin: Mapping[str, Any]) -> Windows:
    """Machines of the population twin at speeds about those to be judged, each with records of every class. It is a
    single machine where no fault has values of several recordings."""
    spec = TwinSpec(twin["model"], tuple(twin["effects"]), None, twin["parameters"], recipe.bearing)
    source, rng = recipe.options, np.random.default_rng([recipe.seed, 68])
    length, parts = source.windows_per_record * recipe.window_samples, []
    try:
        drawn = [own for _, own in machines(spec, recipe.bearings_per_class, rng)]
    except TwingapError:
        drawn = [spec] * recipe.bearings_per_class
    for number, own in enumerate(drawn):
        speeds = rng.choice(recipe.speeds_rpm, (recipe.records_per_bearing, len(recipe.classes)))
        speeds *= 1 + source.speed_spread * rng.uniform(-1, 1, speeds.shape)
        conditions = [
            Condition(f"{fault}-{number}-{i}", float(speed), recipe.fs_hz, length, fault, group=f"{fault}-{number}")
            for i, row in enumerate(speeds)
            for fault, speed in zip(recipe.classes, row, strict=True)
        ]
        made = simulate_twin(conditions, own, seed=rng)
        parts.append(cut(made, recipe.window_samples, source.windows_per_record, recipe.classes))
    return joined(parts)


_SIMULATED: Final[Mapping[str, Callable[[Recipe, Mapping[str, Any]], Windows]]] = {
    CONTACT: lambda recipe, twin: simulate(recipe), FLEETS: _of_fleets, POPULATION: _of_population,
}  # fmt: skip


def _rows(windows: Windows, bearing: Bearing) -> tuple[Array, Labels]:
    assert windows.labels is not None
    return order_features(windows, bearing), windows.labels
