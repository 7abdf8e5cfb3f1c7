"""The paper's comparison: nine methods and the analyst's rule, seven tasks, three states of the target data, noise.

tasks/*.toml, records --> cell: adapt (labels taken away) | judge (other recordings)
                            |
        identify k, c (no labels) --> contact twin --> labelled windows --> trials: method x seed x SNR
                                                                                |
                           tables, figures, MLflow (task > method > trial) <----+

Used in: Paper 3, section 4, DOI 10.1177/10775463261462852. Run as part of the paper, or alone:
python -m papers.paper3_zoa_dann.comparison --profile core --out DIR
"""

from __future__ import annotations

import dataclasses
import functools
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import twingap.adapt
import twingap.bearing
import twingap.effects
import twingap.records
import twingap.signal
import twingap.streams
import twingap.twins
from papers.paper3_zoa_dann import job as job_module
from papers.paper3_zoa_dann import noise, task_files, yardsticks
from papers.paper3_zoa_dann import options as options_module
from papers.paper3_zoa_dann import source as source_module
from papers.paper3_zoa_dann import trial as trial_module
from papers.paper3_zoa_dann.comparison_study import (
    CONFIG,
    Comparison,
    ComparisonOptions,
    Key,
    Size,
    TaskOutcome,
    read_comparison,
)
from papers.paper3_zoa_dann.job import Identification, identify_twin, windows_digest
from papers.paper3_zoa_dann.options import Options, read_options
from papers.paper3_zoa_dann.source import FREE, Recipe
from papers.paper3_zoa_dann.task_files import FOLDER, Material, TaskFile, load_recordings, material, read_task
from papers.paper3_zoa_dann.tasks import Target
from papers.paper3_zoa_dann.trial import ALL, CLOSED, Trial, noise_words, run_trial
from papers.studies import command
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_path
from twingap.sweep import Result, sweep
from twingap.track import NullTracker, Run

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Cell:
    """What one identification and one set of simulated records serve.

    Parameters
    ----------
    available : str
    unseen : float or None
        Size left out of adaptation.
    seeds : tuple[int, ...]
        Of the trials without noise.
    noise_seeds : tuple[tuple[int, ...], ...]
        Of those at each noise level.
    """

    available: str
    unseen: float | None
    seeds: tuple[int, ...]
    noise_seeds: tuple[tuple[int, ...], ...]


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


def trials(
    task: TaskFile, cell: Cell, recipe: Recipe, options: ComparisonOptions, common: Options, size: Size, seed: int
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


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    device: str = "auto",
    log: Run | None = None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
    config: Path = CONFIG,
    folder: Path = FOLDER,
    draw: bool = True,
) -> Comparison:
    """Run the comparison; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : {"smoke", "noise", "lean", "balanced", "states", "broad", "core", "full"}
        "noise" is a part of "balanced" and of "broad", and "core" of "full".
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without CWRU records the virtual rig is taken, and every number says so;
        without HIT-SM records its tasks are left out.
    seed : int
        First of the seeds, and seed of the simulated records.
    backend, address
        See `twingap.sweep`.
    device : {"auto", "cpu", "cuda"}
        Of the trainings; auto takes a GPU when there is one.
    log : Run or None
        Of a tracker: runs of tasks, methods and trials go under it.
    progress : callable
    config, folder : Path
        The configuration, and where task files are.
    draw : bool
        Make the figures.
    """
    if log is None:
        with NullTracker().run("comparison") as forgetful:
            log = forgetful
    options, common = read_comparison(config), read_options()
    if profile not in options.profiles:
        known = ", ".join(options.profiles)
        raise TwingapError(f"unknown profile {profile!r}", where=config, mend=f"use one of {known}")
    size = options.profiles[profile]
    found: list[tuple[TaskFile, Target]] = []
    missing = []
    for name in size.tasks:
        task = read_task(name, folder)
        if (target := load_recordings(task, root, common.target, size.rig_duration_s)) is None:
            missing.append(name)
        else:
            found.append((task, target))
    if not found:
        mend = "set TWINGAP_DATA, or choose a profile with tasks A1 to A4"
        raise TwingapError(f"no data for {', '.join(missing)}", mend=mend)
    log.parameters({"comparison": options_of(options, profile), "missing": list(missing)})
    log.data("comparison.toml", digest_of_path(config), role="configuration")
    log.data("tasks", digest_of_path(folder), role="configuration")
    total = sum(
        len(ALL) * sum(len(own) for own in (cell.seeds, *cell.noise_seeds))
        for task, _ in found
        for cell in cells(task, size, seed)
    )
    done = 0

    def step(_: Result[Any]) -> None:
        nonlocal done
        done += 1
        progress("comparison", done, total)

    swept = functools.partial(
        sweep, store=out / "results", backend=backend, address=address, version=version(), on_result=step,
        describe=lambda job: job.words,
    )  # fmt: skip
    outcomes = []
    for task, target in found:
        outcome = _run_task(task, target, options, common, size, seed, device, swept, out)
        _log_task(log, outcome)
        outcomes.append(outcome)
    from papers.paper3_zoa_dann import tables, tables_comparison

    made = tables_comparison.all_tables(options, common, outcomes)
    titles = ", ".join(dict.fromkeys(outcome.data for outcome in outcomes))
    for name, frame in made.items():
        tables.write(frame, out / "tables" / name, titles)
        log.table(name, frame)
    if draw:
        from papers.paper3_zoa_dann import figures, figures_comparison

        for name, figure in figures_comparison.all_figures(options, outcomes):
            figures.write(figure, out / "figures" / f"{name}.png")
            log.figure(name, figure)
    computed = sum(bool(t.why) for outcome in outcomes for t in outcome.trials)
    comparison = Comparison(options, outcomes, tuple(missing), made, computed)
    log.metrics({"comparison core hours": comparison.core_hours, "comparison trials": total})
    return comparison


def options_of(options: ComparisonOptions, profile: str) -> dict[str, Any]:
    """What a run with this profile used, for the log."""
    used = dataclasses.replace(options, profiles={profile: options.profiles[profile]})
    return {"profile": profile, **dataclasses.asdict(used)}


@dataclass(frozen=True)
class Prepared:
    """A cell, ready for trials.

    Parameters
    ----------
    cell : Cell
    material : Material
    identified : Mapping[str, float]
    recipe : Recipe
        Of the simulated records.
    """

    cell: Cell
    material: Material
    identified: Mapping[str, float]
    recipe: Recipe


def prepared(
    task: TaskFile, target: Target, common: Options, size: Size, seed: int, out: Path, chosen: Iterable[Cell]
) -> Iterator[Prepared]:
    """Cells with their windows, the twin identified on what is adapted to, and the recipe of the source."""
    bearing = target.records.bearing
    if bearing is None:
        raise TwingapError("brings no bearing geometry", where=f"record set {target.records.name!r}")
    source = dataclasses.replace(common.source, width_mm=task.width_mm)
    for cell in chosen:
        own = material(task, target.records, cell.available, cell.unseen)
        # Identified on what is adapted to and on nothing else; without added noise, as in a quiet hour.
        (identification,) = sweep(
            functools.partial(identify_twin, adapt=own.adapt),
            [Identification(task.name, bearing, task.classes, source, common.identification, size.evaluations)],
            data={"adapt": windows_digest([own.adapt])},
            backend="sequential",
            store=out / "results",
            version=version(),
        )
        recipe = Recipe(
            **{name: identification.value[name] for name in FREE},
            # Of the machine to be diagnosed: its speed is known without any label.
            speeds_rpm=tuple(sorted({float(speed) for speed in own.evaluate.speed_rpm})),
            fs_hz=task.fs_hz,
            bearing=bearing,
            classes=task.classes,
            options=source,
            bearings_per_class=size.bearings_per_class,
            records_per_bearing=size.records_per_bearing,
            window_samples=task.window_samples,
            seed=seed,
        )
        yield Prepared(cell, own, identification.value, recipe)


@contextmanager
def kept_modes(out: Path) -> Iterator[Path]:
    """A folder for the modes that trials of one cell share, gone with the block: of all cells they are gigabytes."""
    folder = (out / "modes").absolute()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _run_task(
    task: TaskFile,
    target: Target,
    options: ComparisonOptions,
    common: Options,
    size: Size,
    seed: int,
    device: str,
    swept: Callable[..., list[Result[Any]]],
    out: Path,
) -> TaskOutcome:
    materials: dict[Key, Material] = {}
    identified: dict[Key, Mapping[str, float]] = {}
    results: list[Result[Trial]] = []
    for ready in prepared(task, target, common, size, seed, out, cells(task, size, seed)):
        key = (ready.cell.available, ready.cell.unseen)
        materials[key], identified[key] = ready.material, ready.identified
        # The device is bound and no part of the key: what a training is does not depend on where it runs.
        with kept_modes(out) as modes:
            results += swept(
                functools.partial(run_trial, material=ready.material, device=device, modes=modes),
                list(trials(task, ready.cell, ready.recipe, options, common, size, seed)),
                data={"material": ready.material.digest},
            )
    return TaskOutcome(task, target.title, materials, identified, results)


@functools.cache
def version() -> str:
    """Digest of all code that a trial or an identification depends on."""
    return digest_of_code(
        trial_module, noise, task_files, job_module, source_module, options_module, yardsticks, twingap.adapt,
        twingap.bearing, twingap.effects, twingap.records, twingap.signal, twingap.streams, twingap.twins,
    )  # fmt: skip


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
                quiet = [t.value["accuracy"] for t in own_trials if t.job.snr_db is None]
                if quiet:
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
    log.metrics(
        {
            "accuracy": value["accuracy"],
            "balanced accuracy": value["balanced_accuracy"],
            "oracle accuracy": value["oracle_accuracy"],
            "accuracy, unseen bearings": unseen.get("accuracy"),
            "source accuracy at choice": value["source_accuracy"],
            "seconds": found.seconds,
        }
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """The comparison from the command line."""
    command(
        run, "Paper 3's comparison of methods: tables and figures.", _shown, arguments,
        takes=("root", "seed", "device"), told=_told,
    )  # fmt: skip


def _shown(made: Comparison) -> dict[str, pd.DataFrame]:
    import pandas as pd

    from papers.paper3_zoa_dann.tables_comparison import shown

    return {"accuracy": pd.DataFrame(shown(made.tables)), "published": made.tables["comparison-published"]}


def _told(made: Comparison) -> Iterator[str]:
    if made.missing:
        yield f"no data at hand for {', '.join(made.missing)}: left out"
    count = sum(len(outcome.trials) for outcome in made.outcomes)
    yield f"{count} trials, {made.core_hours:.2f} core hours in all; {made.computed} run now"


if __name__ == "__main__":
    # Workers look functions up by module, and this one is called __main__ here.
    from papers.paper3_zoa_dann.comparison import main as start

    start()
