"""A plain network with and without adaptation, on several inputs: what an input is worth in the paper's frame.

The paper's frame (twin, identification, DANN) with a plain network in place of its own, which `comparison` has.
"""

import dataclasses
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from papers.framework import Result, Run, Work
from papers.logs import log_checkpoints, log_method
from papers.paper3_zoa_dann.inputs.options import Options, Profile
from papers.paper3_zoa_dann.job import Identification, Job, Measured, identified, train_and_judge, windows_digest
from papers.paper3_zoa_dann.source import FREE, Recipe
from papers.paper3_zoa_dann.tasks import Target, Task, load_target, make_tasks
from papers.paper3_zoa_dann.yardsticks import analyst, majority
from twingap import Bearing, TwingapError
from twingap.adapt import Method, Scores, cut, score

METHODS: Final[tuple[Method, ...]] = ("source_only", "dann")
LABELS: Final = {"source_only": "Non-DA", "dann": "DANN"}  # methods in words


@dataclass(frozen=True)
class TaskResult:
    task: Task
    measured: Measured
    identified: Mapping[str, float]
    recipe: Recipe
    trainings: list[Result[Job]]  # in the order input, method, seed
    majority: float  # accuracy of calling everything the most frequent class
    analyst: Scores  # of the analyst's rule on the same windows
    analyst_whole: Scores  # of the same rule on whole recordings
    # analyst_calls, analyst_whole_calls: [windows, classes] what that rule called each, one-hot
    analyst_calls: NDArray[np.float64]
    analyst_whole_calls: NDArray[np.float64]

    @property
    def cells(self) -> dict[tuple[str, str], list[Result[Job]]]:
        """The trainings by (input, method), seeds in order."""
        found: dict[tuple[str, str], list[Result[Job]]] = {}
        for training in self.trainings:
            found.setdefault((training.job.view, training.job.method), []).append(training)
        return found


def load(work: Work) -> Target:
    """Recordings of the machine to diagnose; each one's digest goes to the log."""
    target = load_target(work.options.target, work.root, work.size.rig_duration_s)
    if target.records.bearing is None:
        raise TwingapError("brings no bearing geometry", where=f"record set {target.records.name!r}")
    work.title = target.title
    for place, condition in enumerate(target.records.conditions):
        one = cut(target.records.take([place]), condition.n_samples, 1)
        name = f"{target.records.name} {condition.name}"
        work.log.data(name, windows_digest([one]), role="target", source=target.title)
    return target


def results(work: Work) -> Iterator[TaskResult]:
    """Every task, logged as soon as it is finished."""
    options, size, records = work.options, work.size, work["target"].records
    bearing = records.bearing
    assert bearing is not None
    for task in make_tasks(size.tasks, records):
        own = _measured(task, options, size)
        asked = Identification(
            task.name, bearing, options.target.classes, options.source, options.identification, size.evaluations
        )
        parameters = identified(work, asked, own.adapt, task.title)
        recipe = _recipe(parameters, task, options, size, bearing, work.seed)
        trainings = work.sweep(
            train_and_judge, _jobs(task, recipe, options, size, work.seed), {"measured": (own, own.digest)},
            lambda j: f"{j.task}, {j.view}, {j.method}, seed {j.seed}", f"training, {task.title}",
        )  # fmt: skip
        result = TaskResult(task, own, parameters, recipe, trainings, **_yardsticks(task, own, options, bearing))
        _log_task(work.log, result)
        yield result


def _measured(task: Task, options: Options, size: Profile) -> Measured:
    length, count = options.target.window_samples, size.windows_per_recording
    return Measured(cut(task.adapt, length, count), cut(task.evaluate, length, count, options.target.classes))


def _recipe(
    identified: Mapping[str, float], task: Task, options: Options, sizes: Profile, bearing: Bearing, seed: int
) -> Recipe:
    speeds, fs_hz = tuple(sorted({c.speed_rpm for c in task.adapt.conditions})), task.adapt.conditions[0].fs_hz
    stiffness, damping, white_share = (float(identified[name]) for name in FREE)
    return Recipe(
        stiffness, damping, white_share, speeds, fs_hz, bearing, options.target.classes, options.source,
        sizes.bearings_per_class, sizes.records_per_bearing, options.target.window_samples, seed,
    )  # fmt: skip


def _jobs(task: Task, recipe: Recipe, options: Options, sizes: Profile, seed: int) -> Iterator[Job]:
    training = dataclasses.replace(options.training, steps=sizes.steps)
    judging = options.judging
    for view, method, i in itertools.product(sizes.inputs, METHODS, range(sizes.seeds)):
        yield Job(task.name, view, method, seed + i, training, judging.criterion, judging.held_out, recipe)


def _yardsticks(task: Task, measured: Measured, options: Options, bearing: Bearing) -> dict[str, Any]:
    classes, rate, labels = options.target.classes, options.judging.false_alarm, measured.evaluate.labels
    assert labels is not None
    calls = analyst(measured.evaluate, bearing, classes, rate)
    conditions = task.evaluate.conditions
    each = [cut(task.evaluate.take([i]), c.n_samples, 1, classes) for i, c in enumerate(conditions)]
    whole = np.concatenate([analyst(one, bearing, classes, rate) for one in each])
    whole_truth = np.concatenate([one.labels for one in each if one.labels is not None])
    names = np.array([c.name for c in conditions])
    return {
        "majority": majority(labels, len(classes)), "analyst": score(calls, labels, measured.evaluate.group),
        "analyst_whole": score(whole, whole_truth, names), "analyst_calls": calls, "analyst_whole_calls": whole,
    }  # fmt: skip


def _log_task(log: Run, result: TaskResult) -> None:
    """Nested runs: task, then input and method, then seed."""
    with log.run(result.task.name, {"task": result.task.name}) as of_task:
        of_task.twin(result.recipe.twin_toml())
        of_task.parameters(dict(result.identified), prefix="identified.")
        of_task.metrics({"majority": result.majority, "analyst": result.analyst.accuracy})
        of_task.data("measured windows", result.measured.digest, role="adapt and evaluate")
        for (view, method), trainings in result.cells.items():
            settings = {"task": result.task.name, "input": view, "method": LABELS[method]}
            values = [t.value["accuracy"][t.value["place"]] for t in trainings]
            log_method(of_task, settings, trainings, "accuracy", values, _log_training)


def _log_training(log: Run, training: Result[Job]) -> None:
    value = training.value
    log.parameters({"seed": training.job.seed, "device": value["device"], **dataclasses.asdict(training.job.training)})
    names = {"source loss": "source_loss", "domain accuracy": "domain_accuracy", "accuracy at checkpoint": "accuracy"}
    log_checkpoints(log, value, names)
    log.metrics({
        "accuracy": value["accuracy"][value["place"]], "balanced accuracy": value["balanced_accuracy"][value["place"]],
        "oracle accuracy": max(value["accuracy"]), "source accuracy": value["source_accuracy"],
        "seconds": training.seconds,
    })  # fmt: skip
