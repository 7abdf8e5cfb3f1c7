"""The paper's comparison: nine methods and the analyst's rule, seven tasks, three states of the target data, noise.

Used in: Paper 3, section 4. The paper's README draws how tasks become tables.
"""

import dataclasses
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from papers.framework import Result, Run, Work
from papers.options import expect, read
from papers.paper3_zoa_dann.comparison.task_files import (
    FOLDER,
    Material,
    TaskFile,
    load_recordings,
    material,
    read_task,
)
from papers.paper3_zoa_dann.comparison.trial import ALL, CLOSED, Trial, noise_words, run_trial
from papers.paper3_zoa_dann.inputs import options as frame
from papers.paper3_zoa_dann.job import Identification, identified
from papers.paper3_zoa_dann.source import FREE, Recipe
from papers.paper3_zoa_dann.tasks import Target
from twingap import TwingapError
from twingap.adapt import ModeInputs, Training
from twingap.effects import catalogue
from twingap.provenance import digest_of_path

CONFIG: Final = Path(__file__).with_name("config.toml")
Key = tuple[str, float | None]  # state of the unlabelled data, and the size left out


@dataclass(frozen=True)
class Published:
    """The paper's figures of one data set, per cent and points; explained in config.toml."""

    mean: float
    lead: float
    lead_high_noise: float


@dataclass(frozen=True)
class Size(frame.Size):
    available: tuple[str, ...]
    strict_seeds: int
    noise_seeds: tuple[int, ...]
    snr_db: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.noise_seeds) != len(self.snr_db) or not all(0 <= count <= self.seeds for count in self.noise_seeds):
            found = f"noise_seeds = {list(self.noise_seeds)}"
            raise TwingapError(f"{found}, one of 0 to seeds = {self.seeds} for each of snr_db expected")


@dataclass(frozen=True)
class Options:
    references: tuple[str, ...]
    rivals: tuple[str, ...]
    low_noise_db: float
    high_noise_db: float
    embedded: int
    closed: dict[str, tuple[str, ...]]
    published: dict[str, Published]
    inputs: ModeInputs
    training: Training
    profiles: dict[str, Size]

    def __post_init__(self) -> None:
        for method in (*self.references, *self.rivals):
            expect(method, ALL, "references, rivals")
        for family, names in self.closed.items():
            for effect in names:
                expect(effect, catalogue(), f"closed.{family}")


def read_options(path: Path = CONFIG) -> Options:
    """The comparison's configuration, for studies that share it."""
    return read(Options, path)


@dataclass(frozen=True)
class TaskOutcome:
    task: TaskFile
    data: str  # what stands beside every number
    materials: Mapping[Key, Material]
    identified: Mapping[Key, Mapping[str, float]]
    trials: Sequence[Result[Trial]]


@dataclass(frozen=True)
class Cell:
    """What one identification and one set of simulated records serve."""

    available: str
    unseen: float | None  # size left out of adaptation
    seeds: tuple[int, ...]  # of the trials without noise
    noise_seeds: tuple[tuple[int, ...], ...]  # of those at each noise level


def cells(task: TaskFile, size: Size, seed: int) -> Iterator[Cell]:
    """What is run of a task. Where bearings are left out, each seed leaves out one size."""

    def seeds(count: int, unseen: float | None) -> tuple[int, ...]:
        return tuple(s for s in range(seed, seed + count) if unseen is None or task.unseen(s) == unseen)

    for available in size.available:
        balanced = available == "balanced"
        for unseen in (None,) if task.same_bearings else task.sizes:
            if own := seeds(size.seeds, unseen):
                noisy = tuple(seeds(count if balanced else 0, unseen) for count in size.noise_seeds)
                yield Cell(available, unseen, own, noisy)
    if task.same_bearings:
        for unseen in task.sizes:
            if own := seeds(size.strict_seeds, unseen):
                yield Cell("balanced", unseen, own, ((),) * len(size.snr_db))


def balanced_cells(task: TaskFile, work: Work) -> list[Cell]:
    """Those of balanced data, for studies that have no other."""
    return [cell for cell in cells(task, work.size, work.seed) if cell.available == "balanced"]


def trials(
    task: TaskFile, cell: Cell, recipe: Recipe, options: Options, common: frame.Options, size: Size, seed: int
) -> Iterator[Trial]:
    """The trials of a cell: without noise first, methods in turn, so that what is done early can be compared."""
    training = dataclasses.replace(options.training, steps=size.steps)
    judging = common.judging
    main = cell.available == "balanced" and (cell.unseen is None) == task.same_bearings
    for snr_db, chosen in zip((None, *size.snr_db), (cell.seeds, *cell.noise_seeds), strict=True):
        drawn = main and snr_db in (None, options.high_noise_db)
        for one in chosen:
            for method in ALL:
                own = dataclasses.replace(recipe, closed=options.closed[task.family]) if method in CLOSED else recipe
                yield Trial(
                    task.name, cell.available, cell.unseen, method, one, snr_db, training, options.inputs,
                    judging.criterion, judging.held_out, judging.false_alarm, own,
                    options.embedded if drawn and one == seed else 0,
                )  # fmt: skip


@dataclass(frozen=True)
class Prepared:
    cell: Cell
    material: Material
    identified: Mapping[str, float]
    recipe: Recipe  # of the simulated records

    @property
    def inputs(self) -> dict[str, tuple[Any, str | None]]:
        return {"material": (self.material, self.material.digest)}


def load_tasks(work: Work) -> list[tuple[TaskFile, Target]]:
    """The profile's tasks, as far as their data are at hand; task files lie beside the configuration."""
    found: list[tuple[TaskFile, Target]] = []
    missing = []
    own, common = work.config.with_name("tasks"), frame.read_options()
    folder = own if own.is_dir() else FOLDER
    for name in work.size.tasks:
        task = read_task(name, folder)
        if (target := load_recordings(task, work.root, common.target, work.size.rig_duration_s)) is None:
            missing.append(name)
        else:
            found.append((task, target))
    if not found:
        mend = "set TWINGAP_DATA, or choose a profile with tasks A1 to A4"
        raise TwingapError(f"no data for {', '.join(missing)}", mend=mend)
    work.log.data("tasks", digest_of_path(folder), role="configuration")
    work.missing = tuple(missing)
    work.title = ", ".join(dict.fromkeys(target.title for _, target in found))
    return found


def prepared(work: Work, task: TaskFile, target: Target, chosen: Iterable[Cell]) -> Iterator[Prepared]:
    """Cells with their windows, the twin identified on what is adapted to, and the recipe of the source."""
    bearing = target.records.bearing
    if bearing is None:
        raise TwingapError("brings no bearing geometry", where=f"record set {target.records.name!r}")
    common, size = frame.read_options(), work.size
    source = dataclasses.replace(common.source, width_mm=task.width_mm)
    for cell in chosen:
        own = material(task, target.records, cell.available, cell.unseen)
        # Identified on what is adapted to and on nothing else; without added noise, as in a quiet hour.
        asked = Identification(task.name, bearing, task.classes, source, common.identification, size.evaluations)
        parameters = identified(work, asked, own.adapt, task.name)
        # Of the machine to be diagnosed: its speed is known without any label.
        speeds = tuple(sorted({float(speed) for speed in own.evaluate.speed_rpm}))
        stiffness, damping, white_share = (parameters[name] for name in FREE)
        recipe = Recipe(
            stiffness, damping, white_share, speeds, task.fs_hz, bearing, task.classes, source,
            size.bearings_per_class, size.records_per_bearing, task.window_samples, work.seed,
        )  # fmt: skip
        yield Prepared(cell, own, parameters, recipe)


@contextmanager
def kept_modes(out: Path) -> Iterator[Path]:
    """A folder for the modes that trials of one cell share, gone with the block: of all cells they are gigabytes."""
    folder = (out / "modes").absolute()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def outcomes(work: Work) -> Iterator[TaskOutcome]:
    """Every task, logged as soon as it is finished."""
    options, common, size = work.options, frame.read_options(), work.size
    for task, target in work["tasks"]:
        materials: dict[Key, Material] = {}
        identified: dict[Key, Mapping[str, float]] = {}
        results: list[Result[Trial]] = []
        for ready in prepared(work, task, target, cells(task, size, work.seed)):
            key = (ready.cell.available, ready.cell.unseen)
            materials[key], identified[key] = ready.material, ready.identified
            # The device is bound and no part of the key: what a training is does not depend on where it runs.
            jobs = trials(task, ready.cell, ready.recipe, options, common, size, work.seed)
            with kept_modes(work.out) as modes:
                inputs = ready.inputs | {"device": (work.device, None), "modes": (modes, None)}
                results += work.sweep(run_trial, jobs, inputs, lambda job: job.words, f"task {task.name}")
        outcome = TaskOutcome(task, target.title, materials, identified, results)
        _log_task(work.log, outcome)
        yield outcome


def _log_task(log: Run, outcome: TaskOutcome) -> None:
    """Nested runs: task, then method, then seed and noise."""
    task = outcome.task
    with log.run(task.name, {"task": task.name, "data": outcome.data}) as of_task:
        of_task.parameters(task)
        for (available, unseen), own in outcome.materials.items():
            of_task.data(f"{available} {unseen or ''}".strip(), own.digest, role="adapt and evaluate")
        for (available, unseen), values in outcome.identified.items():
            of_task.parameters(dict(values), prefix=f"identified.{available}.{unseen or 'all'}.")
        for method in ALL:
            own_trials = [t for t in outcome.trials if t.job.method == method]
            with of_task.run(f"{task.name} · {method}", {"task": task.name, "method": method}) as of_method:
                of_method.parameters({"task": task.name, "method": method})
                if quiet := [t.value["accuracy"] for t in own_trials if t.job.snr_db is None]:
                    of_method.metrics({"accuracy": float(np.mean(quiet)), "trials": len(quiet)})
                for found in own_trials:
                    settings = {
                        "task": task.name, "method": method, "available": found.job.available,
                        "noise": noise_words(found.job.snr_db), "unseen": found.job.unseen,
                    }  # fmt: skip
                    tags = {**settings, "seed": found.job.seed, "store key": found.key}
                    name = f"{task.name} · {method} · {found.label}"
                    with of_method.run(name, tags, duration_s=found.seconds) as of_trial:
                        of_trial.parameters(settings)
                        _log_trial(of_trial, found)


def _log_trial(log: Run, found: Result[Trial]) -> None:
    value = found.value
    log.parameters({"seed": found.job.seed, "device": value["device"], **dataclasses.asdict(found.job.training)})
    for row, accuracy in zip(value["history"], value["accuracy_by_checkpoint"], strict=False):
        curves = {name: number for name, number in row.items() if name != "step"}
        log.metrics({**curves, "accuracy at checkpoint": accuracy}, step=round(row["step"]))
    unseen = value["unseen"] or {}
    log.metrics({
        "accuracy": value["accuracy"], "balanced accuracy": value["balanced_accuracy"],
        "oracle accuracy": value["oracle_accuracy"], "accuracy, unseen bearings": unseen.get("accuracy"),
        "source accuracy at choice": value["source_accuracy"], "seconds": found.seconds,
    })  # fmt: skip
