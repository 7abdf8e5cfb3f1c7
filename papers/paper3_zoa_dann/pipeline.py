"""Paper 3: identification study, comparison of the nine methods, and a plain network with and without adaptation.

CWRU, or virtual rig --> recordings --> task: adapt | evaluate
                                          |        |
              identify k, c (no labels) <-+        |
                        |                 |        |
   contact twin --> labelled windows --> train (source_only, dann) x inputs x seeds --> select (no labels)
                                                   |                                          |
                                                   +--> judge <-------------------------------+
                                                          |
                                             tables, figures, MLflow runs

Used in: Paper 3, dynamics-assisted unsupervised domain adaptation for rolling bearing fault diagnosis, Journal of
Vibration and Control, DOI 10.1177/10775463261462852. What is drawn above is its frame (twin, identification, DANN) with
a plain network in place of the paper's, which shows what inputs are worth; `identification` and `comparison` are
studies of their own, run first.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

import twingap.adapt
import twingap.bearing
import twingap.effects
import twingap.records
import twingap.signal
import twingap.streams
import twingap.twins
from papers.paper3_zoa_dann import comparison as comparison_module
from papers.paper3_zoa_dann import identification as identification_module
from papers.paper3_zoa_dann import job as job_module
from papers.paper3_zoa_dann import options as options_module
from papers.paper3_zoa_dann import source as source_module
from papers.paper3_zoa_dann import tables
from papers.paper3_zoa_dann.comparison_study import read_comparison
from papers.paper3_zoa_dann.identification_study import read_study
from papers.paper3_zoa_dann.job import Identification, Job, Measured, identify_twin, train_and_judge, windows_digest
from papers.paper3_zoa_dann.options import CONFIG, Options, Profile, read_options
from papers.paper3_zoa_dann.results import Outcome, TaskResult
from papers.paper3_zoa_dann.source import FREE, Recipe
from papers.paper3_zoa_dann.tasks import Target, Task, load_target, make_tasks
from papers.paper3_zoa_dann.yardsticks import analyst, majority
from twingap import files
from twingap.adapt import Method, cut, score
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_path
from twingap.records import RecordSet
from twingap.sweep import Result, sweep
from twingap.sweep.backends import BACKENDS
from twingap.track import NullTracker, Run, Tracker

METHODS: Final[tuple[Method, ...]] = ("source_only", "dann")
Progress = Callable[[str, int, int], None]
"""Called with what is going on, how much of it is done, and how much there is."""


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    tracker: Tracker | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> Outcome:
    """Run the paper's studies; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : str
        "smoke" or "full" (see config.toml).
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``, the store of finished trainings. Results computed
        elsewhere can be copied into it: their keys depend on configuration, code and data, not on machine or path.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without the data the virtual rig is taken, and every number says so.
    seed : int
        First of the profile's seeds, and seed of the simulated records.
    backend, address
        Where trainings run; see `twingap.sweep`.
    tracker : Tracker or None
        Where the run is logged; None keeps no log.
    progress : callable
    config : Path
    draw : bool
        Make the figures.

    Returns
    -------
    Outcome

    Raises
    ------
    TwingapError
        For a configuration, data root, backend or folder that cannot be used.
    """
    options = read_options(config)
    sizes = options.profile(profile)
    if backend not in BACKENDS:
        raise TwingapError(f"unknown backend {backend!r}", mend=f"use one of {', '.join(BACKENDS)}")
    files.try_folder(out)
    target = load_target(options.target, root, sizes.rig_duration_s)
    bearing = target.records.bearing
    if bearing is None:
        raise TwingapError("brings no bearing geometry", where=f"record set {target.records.name!r}")
    tasks = make_tasks(sizes.tasks, target.records)
    version = _version()
    total = len(tasks) * len(sizes.inputs) * len(METHODS) * sizes.seeds
    done = 0

    def step(_: Result[Any]) -> None:
        nonlocal done
        done += 1
        progress("training", done, total)

    results: list[TaskResult] = []
    tags = {"paper": "paper3", "profile": profile, "data": target.title}
    with (tracker or NullTracker()).run(f"paper3 · {profile} · seed {seed}", tags) as log:
        _log_inputs(log, options, sizes, profile, seed, target, config)
        if profile in read_study().profiles:
            identification_module.run(
                profile, out=out, root=root, backend=backend, address=address, log=log, progress=progress, draw=draw
            )
        comparison = None
        if profile in read_comparison().profiles:
            comparison = comparison_module.run(
                profile, out=out, root=root, seed=seed, backend=backend, address=address, log=log, progress=progress,
                draw=draw,
            )  # fmt: skip
        for task in tasks:
            measured = _measured(task, options, sizes)
            progress(f"identifying the twin, {task.title}", done, total)
            (identification,) = sweep(
                functools.partial(identify_twin, adapt=measured.adapt),
                [
                    Identification(
                        task.name, bearing, options.target.classes, options.source, options.identification,
                        sizes.evaluations,
                    )
                ],
                data={"adapt": windows_digest([measured.adapt])},
                backend="sequential",
                store=out / "results",
                version=version,
            )  # fmt: skip
            recipe = _recipe(identification.value, task, options, sizes, bearing, seed)
            jobs = list(_jobs(task, recipe, options, sizes, seed))
            progress("training", done, total)
            trainings = sweep(
                functools.partial(train_and_judge, measured=measured),
                jobs,
                data={"measured": measured.digest},
                on_result=step,
                describe=lambda j: f"{j.task}, {j.view}, {j.method}, seed {j.seed}",
                backend=backend,
                address=address,
                store=out / "results",
                version=version,
            )
            result = _judged(task, measured, identification.value, recipe, trainings, options, target.records)
            _log_task(log, result)
            results.append(result)
        rows = tables.accuracy(results, options, target.title)
        progress("tables and figures", total, total)
        _publish(log, results, options, target, rows, out, draw)
        computed = sum(bool(t.why) for r in results for t in r.trainings)
        return Outcome(profile, target, options, results, rows, out, getattr(log, "id", None), computed, comparison)


def _version() -> str:
    """Digest of all code that a training or an identification depends on."""
    return digest_of_code(
        job_module, source_module, options_module, twingap.adapt, twingap.bearing, twingap.effects, twingap.records,
        twingap.signal, twingap.streams, twingap.twins,
    )  # fmt: skip


def _measured(task: Task, options: Options, sizes: Profile) -> Measured:
    length, count = options.target.window_samples, sizes.windows_per_recording
    return Measured(cut(task.adapt, length, count), cut(task.evaluate, length, count, options.target.classes))


def _recipe(
    identified: Mapping[str, float], task: Task, options: Options, sizes: Profile, bearing: Any, seed: int
) -> Recipe:
    return Recipe(
        **{name: float(identified[name]) for name in FREE},  # type: ignore[arg-type]
        speeds_rpm=tuple(sorted({c.speed_rpm for c in task.adapt.conditions})),
        fs_hz=task.adapt.conditions[0].fs_hz,
        bearing=bearing,
        classes=options.target.classes,
        options=options.source,
        bearings_per_class=sizes.bearings_per_class,
        records_per_bearing=sizes.records_per_bearing,
        window_samples=options.target.window_samples,
        seed=seed,
    )


def _jobs(task: Task, recipe: Recipe, options: Options, sizes: Profile, seed: int) -> Iterator[Job]:
    training = dataclasses.replace(options.training, steps=sizes.steps)
    judging = options.judging
    for view in sizes.inputs:
        for method in METHODS:
            for i in range(sizes.seeds):
                yield Job(
                    task.name, view, method, seed + i, training, judging.criterion, judging.held_out, recipe,
                    judging.embedded if i == 0 else 0,
                )  # fmt: skip


def _judged(
    task: Task,
    measured: Measured,
    identified: Mapping[str, float],
    recipe: Recipe,
    trainings: list[Result[Job]],
    options: Options,
    records: RecordSet,
) -> TaskResult:
    """Add the yardsticks."""
    classes, rate = options.target.classes, options.judging.false_alarm
    labels, bearing = measured.evaluate.labels, records.bearing
    assert labels is not None and bearing is not None
    calls = analyst(measured.evaluate, bearing, classes, rate)
    votes, truth = [], []
    for i, condition in enumerate(task.evaluate.conditions):
        whole = cut(task.evaluate.take([i]), condition.n_samples, 1, classes)
        votes.append(analyst(whole, bearing, classes, rate)[0])
        truth.append(whole.labels)
    names = np.array([c.name for c in task.evaluate.conditions])
    whole_calls = np.array(votes)
    return TaskResult(
        task,
        measured,
        identified,
        recipe,
        trainings,
        majority(labels, len(classes)),
        score(calls, labels, measured.evaluate.group),
        score(whole_calls, np.concatenate([t for t in truth if t is not None]), names),
        calls,
        whole_calls,
    )


def _log_inputs(
    log: Run, options: Options, sizes: Profile, profile: str, seed: int, target: Target, config: Path
) -> None:
    used = dataclasses.replace(options, profiles={profile: sizes})
    log.parameters({**dataclasses.asdict(used), "profile": profile, "seed": seed})
    log.data("config.toml", digest_of_path(config), role="configuration")
    for place, condition in enumerate(target.records.conditions):
        one = cut(target.records.take([place]), condition.n_samples, 1)
        log.data(f"{target.records.name} {condition.name}", windows_digest([one]), role="target", source=target.title)


def _log_task(log: Run, result: TaskResult) -> None:
    """Nested runs: task, then input and method, then seed."""
    with log.run(result.task.name, {"task": result.task.name}) as of_task:
        of_task.twin(result.recipe.twin_toml())
        of_task.parameters(dict(result.identified), prefix="identified.")
        of_task.metrics({"majority": result.majority, "analyst": result.analyst.accuracy})
        of_task.data("measured windows", result.measured.digest, role="adapt and evaluate")
        cells: dict[tuple[str, str], list[Result[Job]]] = {}
        for training in result.trainings:
            cells.setdefault((training.job.view, training.job.method), []).append(training)
        for (view, method), trainings in cells.items():
            settings = {"task": result.task.name, "input": view, "method": tables.LABELS[method]}
            words = " · ".join(settings.values())
            with of_task.run(words, settings) as of_cell:
                values = [t.value["accuracy"][t.value["place"]] for t in trainings]
                of_cell.parameters(settings)
                of_cell.metrics({"accuracy": float(np.mean(values)), "accuracy std": tables.std(values)})
                for training in trainings:
                    name = f"{words} · seed {training.job.seed}"
                    with of_cell.run(name, {"store key": training.key}, duration_s=training.seconds) as of_seed:
                        of_seed.parameters(settings)
                        _log_training(of_seed, training)


def _log_training(log: Run, training: Result[Job]) -> None:
    value = training.value
    log.parameters({"seed": training.job.seed, "device": value["device"], **dataclasses.asdict(training.job.training)})
    for place, at in enumerate(value["steps"]):
        curves = {f"criterion {name}": scores[place] for name, scores in value["criteria"].items()}
        log.metrics(
            {
                "source loss": value["source_loss"][place],
                "domain accuracy": value["domain_accuracy"][place],
                "accuracy at checkpoint": value["accuracy"][place],
                **curves,
            },
            step=at,
        )
    log.metrics(
        {
            "accuracy": value["accuracy"][value["place"]],
            "balanced accuracy": value["balanced_accuracy"][value["place"]],
            "oracle accuracy": max(value["accuracy"]),
            "source accuracy": value["source_accuracy"],
            "seconds": training.seconds,
        }
    )


def _publish(
    log: Run,
    results: list[TaskResult],
    options: Options,
    target: Target,
    rows: list[dict[str, Any]],
    out: Path,
    draw: bool,
) -> None:
    """Tables and figures: to the run and to the folder."""
    made = {
        "accuracy": tables.frame(rows),
        "confusion": tables.confusion(results, options, target.title),
        "recordings": tables.recordings(results, options, target.title),
        "adaptation": tables.frame(tables.adaptation(results, options, target.title)),
        "selection": tables.selection(results, target.title),
        "identification": tables.identification(results, target.title),
    }
    for name, frame in made.items():
        log.table(name, frame)
        tables.write(frame, out / "tables" / name, target.title)
    if not draw:
        return
    from papers.paper3_zoa_dann import figures

    for name, figure in figures.all_figures(results, options, target.title):
        log.figure(name, figure)
        figures.write(figure, out / "figures" / f"{name}.png")
