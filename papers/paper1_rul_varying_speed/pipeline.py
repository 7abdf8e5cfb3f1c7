"""Paper 1: five models on every run, five seeds each; tables 3 and 5 and figures 3 to 14; five studies beside it.

Smart Maintenance set, or virtual rig --> cases --> twin, up to now --> simulated lives --> five models x seeds
                                                                                                    |
                     tables, figures, MLflow runs <-- judged on the run to its end <-- chosen without labels
                                    ^--- femto, rig_lives, ablation, life_gap, femto_lives: studies of full

Used in: Simulation-based remaining useful life prediction of rolling element bearings under varying operating
conditions. The method is in `twingap.prognosis`; here is the study.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from papers.paper1_rul_varying_speed import ablation, femto, femto_lives, life_gap, rig_lives, tables
from papers.paper1_rul_varying_speed.cases import Case, Target, load_target, read_case
from papers.paper1_rul_varying_speed.job import Job, train_and_judge
from papers.paper1_rul_varying_speed.models import architecture_of
from papers.paper1_rul_varying_speed.options import CONFIG, Options, Profile, read_options
from papers.paper1_rul_varying_speed.results import CaseResult, Outcome
from papers.paper1_rul_varying_speed.training_code import code_of_training
from twingap import files
from twingap.errors import TwingapError
from twingap.provenance import digest_of_path
from twingap.sweep import Result, sweep
from twingap.sweep.backends import BACKENDS
from twingap.track import NullTracker, Run, Tracker

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
    """Run the study; what an interrupted run has finished is taken up again.

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
        First of the profile's seeds.
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
        For a configuration, data root, backend or folder that cannot be used, or a run of which nothing can be said.
    """
    options = read_options(config)
    sizes = options.profile(profile)
    if backend not in BACKENDS:
        raise TwingapError(f"unknown backend {backend!r}", mend=f"use one of {', '.join(BACKENDS)}")
    files.try_folder(out)
    total = len(sizes.bearings) * len(sizes.variants) * len(sizes.models) * sizes.seeds
    done = 0

    def step(_: Result[Any]) -> None:
        nonlocal done
        done += 1
        progress("training", done, total)

    def making(what: str, fraction: float) -> None:
        progress(f"virtual rig, {what}: {100 * fraction:.0f} %", done, total)

    progress("reading the runs", done, total)
    target = load_target(options.target, root, sizes.bearings, making)
    version = code_of_training()
    results: list[CaseResult] = []
    tags = {"paper": "paper1", "profile": profile, "data": target.title}
    with (tracker or NullTracker()).run(f"paper1 · {profile} · seed {seed}", tags) as log:
        _log_inputs(log, options, sizes, profile, seed, config)
        for name in sizes.bearings:
            progress(f"adapting the twin, {name}", done, total)
            case = read_case(target, name, options.target, options.adaptation)
            log.data(f"run {name}", case.digest, role="target", source=target.title)
            progress("training", done, total)
            trainings = sweep(
                functools.partial(train_and_judge, case=case),
                list(_jobs(case, options, sizes, seed)),
                data={"run": case.digest, "adaptation": repr(options.adaptation)},
                on_result=step,
                describe=lambda j: f"{j.bearing}, {j.variant} twin, {j.model}, seed {j.seed}",
                backend=backend,
                address=address,
                store=out / "results",
                version=version,
            )
            results += [
                CaseResult(case, variant, [t for t in trainings if t.job.variant == variant])
                for variant in sizes.variants
            ]
            _log_case(log, results[-len(sizes.variants) :], target)
        rows = tables.errors(results, options, target.title)
        progress("tables and figures", total, total)
        _publish(log, results, options, target, rows, out, draw)
        given = {"root": root, "seed": seed, "backend": backend, "address": address, "progress": progress}
        missing = beside(log, profile, config, {**given, "out": out, "draw": draw})
        computed = sum(bool(t.why) for r in results for t in r.trainings)
        return Outcome(
            profile, target.title, target.real, options, results, rows, out, getattr(log, "id", None), computed,
            missing,
        )  # fmt: skip


def beside(log: Run, profile: str, config: Path, given: Mapping[str, Any]) -> tuple[str, ...]:
    """Run the studies beside the trainings, on real runs and on the gap, each in a run of its own.

    Parameters
    ----------
    log : Run
    profile : str
        They are parts of the full one, and commands of their own for any other.
    config : Path
    given : Mapping
        What every study takes.

    Returns
    -------
    tuple of str
        Those whose data are not at hand.
    """
    if profile != "full":
        return ()
    studies: dict[str, Callable[..., Any]] = {
        "rig_lives": rig_lives.run,
        "ablation": functools.partial(ablation.run, config=config),
        "life_gap": functools.partial(life_gap.run, config=config),
    }
    missing: tuple[str, ...] = ("femto", "femto_lives")
    if femto.at_hand(given["root"]):
        on_lives = functools.partial(femto_lives.run, config=config)
        studies, missing = {"femto": femto.run, **studies, "femto_lives": on_lives}, ()
    for name, study in studies.items():
        with log.run(name, {"paper": "paper1", "study": name, "profile": profile}) as of_study:
            of_study.parameters({"profile": profile, "seed": given["seed"]})
            study(profile, log=of_study, **given)
    return missing


def _jobs(case: Case, options: Options, sizes: Profile, seed: int) -> Iterator[Job]:
    """Models innermost: those of a twin and seed share their simulated records."""
    for variant in sizes.variants:
        chosen = options.variants[variant]
        own = dataclasses.replace(options.training, steps=sizes.steps, alike=chosen.alike)
        for i in range(sizes.seeds):
            for model in sizes.models:
                shape = architecture_of(model, printed=options.judging.printed)
                yield Job(
                    case.name, variant, model, dataclasses.replace(shape, length=options.target.window_samples),
                    seed + i, own, chosen.signal, sizes.copies, sizes.most_records, options.judging.criterion,
                    embedded=i == 0,
                )  # fmt: skip


def _log_inputs(log: Run, options: Options, sizes: Profile, profile: str, seed: int, config: Path) -> None:
    used = dataclasses.replace(options, profiles={profile: sizes})
    log.parameters({**dataclasses.asdict(used), "profile": profile, "seed": seed})
    log.data("config.toml", digest_of_path(config), role="configuration")


def _log_case(log: Run, results: list[CaseResult], target: Target) -> None:
    """Nested runs: bearing, then twin and model, then seed."""
    case, twin = results[0].case, results[0].case.known.twin
    with log.run(case.name, {"bearing": case.name, "data": target.title}) as of_case:
        (read,) = tables.runs(results[:1], target.title).to_dict("records")
        of_case.metrics({str(k): v for k, v in read.items() if isinstance(v, (int, float))})
        of_case.parameters(
            {"onset_row": twin.onset_row, "now_row": twin.now_row, "lives": [life.rate for life in twin.lives],
             "waited": list(case.waited)}
        )  # fmt: skip
        for result in results:
            for model in result.models:
                settings = {"task": case.name, "twin": result.variant, "method": model}
                words = " · ".join(settings.values())
                with of_case.run(words, settings) as of_model:
                    errors = [t.value["rmse_min"][t.value["place"]] for t in result.of(model)]
                    of_model.parameters(settings)
                    of_model.metrics({"rmse min": float(np.mean(errors)), "rmse min std": tables.std(errors)})
                    for trained in result.of(model):
                        name = f"{words} · seed {trained.job.seed}"
                        with of_model.run(name, {"store key": trained.key}, duration_s=trained.seconds) as of_seed:
                            of_seed.parameters(settings)
                            _log_training(of_seed, trained)


def _log_training(log: Run, trained: Result[Job]) -> None:
    value, job = trained.value, trained.job
    log.parameters({
        "seed": job.seed, "device": value["device"], "architecture": dataclasses.asdict(job.architecture),
        "training": dataclasses.asdict(job.training), "simulated records": value["simulated"],
    })  # fmt: skip
    for place, at in enumerate(value["steps"]):
        curves = {f"criterion {name}": scores[place] for name, scores in value["criteria"].items()}
        log.metrics(
            {
                "loss": value["loss"][place],
                "domain accuracy": value["domain_accuracy"][place],
                "rmse min at checkpoint": value["rmse_min"][place],
                **curves,
            },
            step=at,
        )
    log.metrics({
        "rmse min": value["rmse_min"][value["place"]], "oracle rmse min": min(value["rmse_min"]),
        "seconds": trained.seconds,
    })  # fmt: skip


def _publish(
    log: Run,
    results: list[CaseResult],
    options: Options,
    target: Target,
    rows: list[dict[str, Any]],
    out: Path,
    draw: bool,
) -> None:
    """Tables and figures: to the run and to the folder."""
    made = {
        "errors": tables.frame(rows),
        "table5": tables.table5(rows, target.title),
        "comparison": tables.comparison(results, options, target.title),
        "gap": tables.gap(rows, target.title),
        "runs": tables.runs([r for r in results if r.variant == results[0].variant], target.title),
        "network": tables.network(results, options, target.title),
        "selection": tables.selection(results, target.title),
        "predictions": tables.predictions(results, target.title),
    }
    for name, table in made.items():
        log.table(name, table)
        tables.write(table, out / "tables" / name, target.title)
    if not draw:
        return
    from papers.paper1_rul_varying_speed import figures

    for name, figure in figures.all_figures(results, options, target.title):
        log.figure(name, figure)
        figures.write(figure, out / "figures" / f"{name}.png")
