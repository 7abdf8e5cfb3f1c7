"""Remaining life by five models on every run, five seeds each: tables 3 and 5 and figures 3 to 14."""

import dataclasses
import itertools
from collections.abc import Iterator

from papers.framework import Result, Run, Work
from papers.logs import log_checkpoints, log_method
from papers.paper1_rul_varying_speed.cases import Case, Target, load_target, read_case
from papers.paper1_rul_varying_speed.job import CaseResult, Job, job_of, train_and_judge
from papers.paper1_rul_varying_speed.lives import tables
from papers.paper1_rul_varying_speed.lives.options import Options, Profile
from papers.paper1_rul_varying_speed.methods.architecture import architecture_of


def target(work: Work) -> Target:
    def made(what: str, fraction: float) -> None:
        work.progress(f"virtual rig, {what}", round(100 * fraction), 100)

    found = load_target(work.options.target, work.root, work.size.bearings, made)
    work.title = found.title
    return found


def results(work: Work) -> Iterator[CaseResult]:
    """Every run with every twin, logged as soon as it is finished."""
    options, size = work.options, work.size
    for name in size.bearings:
        case = read_case(work["target"], name, options.target, options.adaptation)
        work.log.data(f"run {name}", case.digest, role="target", source=work.title)
        trainings = work.sweep(
            train_and_judge, _jobs(case, options, size, work.seed), {"case": (case, case.digest)},
            lambda j: f"{j.bearing}, {j.variant} twin, {j.model}, seed {j.seed}", f"training, {name}",
            data={"adaptation": repr(options.adaptation)},
        )  # fmt: skip
        own = [
            CaseResult(case, variant, [t for t in trainings if t.job.variant == variant]) for variant in size.variants
        ]
        _log_case(work.log, own, work.title)
        yield from own


def _jobs(case: Case, options: Options, sizes: Profile, seed: int) -> Iterator[Job]:
    """Models innermost: those of a twin and seed share their simulated records."""
    for variant, i, model in itertools.product(sizes.variants, range(sizes.seeds), sizes.models):
        shape = architecture_of(model, printed=options.judging.printed)
        yield job_of(case, options, variant, model, shape, seed + i, sizes, embedded=i == 0)


def _log_case(log: Run, results: list[CaseResult], title: str) -> None:
    """Nested runs: bearing, then twin and model, then seed."""
    case, twin = results[0].case, results[0].case.known.twin
    with log.run(case.name, {"bearing": case.name, "data": title}) as of_case:
        (read,) = tables.runs(results[:1], title).to_dict("records")
        of_case.metrics({str(k): v for k, v in read.items() if isinstance(v, (int, float))})
        of_case.parameters(
            {"onset_row": twin.onset_row, "now_row": twin.now_row, "lives": [life.rate for life in twin.lives],
             "waited": list(case.waited)}
        )  # fmt: skip
        for result in results:
            for model in result.models:
                settings = {"task": case.name, "twin": result.variant, "method": model}
                errors = [t.value["rmse_min"][t.value["place"]] for t in result.of(model)]
                log_method(of_case, settings, result.of(model), "rmse min", errors, _log_training)


def _log_training(log: Run, trained: Result[Job]) -> None:
    value, job = trained.value, trained.job
    log.parameters({
        "seed": job.seed, "device": value["device"], "architecture": dataclasses.asdict(job.architecture),
        "training": dataclasses.asdict(job.training), "simulated records": value["simulated"],
    })  # fmt: skip
    names = {"loss": "loss", "domain accuracy": "domain_accuracy", "rmse min at checkpoint": "rmse_min"}
    log_checkpoints(log, value, names)
    log.metrics({
        "rmse min": value["rmse_min"][value["place"]], "oracle rmse min": min(value["rmse_min"]),
        "seconds": trained.seconds,
    })  # fmt: skip
