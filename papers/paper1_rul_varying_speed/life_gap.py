"""Study of the gap between this paper's twin and the runs, by stage of life and speed, and of adding the named effects.

run, stage, speeds --> records ------------------------------+
the twin at their speeds and peaks to peak --> simulated ----+--> `twingap.gap` --> verdict: a row of life_gap
records from the anomaly to now, bearing by bearing: named effects --> simulated lives --> trainings: life_gap_rmse

Every simulated record has the speed and the peak to peak of a measured one: how a life goes on is another question,
which table 5 answers. Rows after now are looked at for the verdicts alone; what is added to the twin was named on
records up to now, without labels. FEMTO's runs have no twin of lives here: the phenomenological twin is calibrated to
each stage, and nothing is trained on it.

Run as a part of the paper (``twingap run paper1 --profile full``), or alone:
``python -m papers.paper1_rul_varying_speed.life_gap --profile full --out DIR``; interrupted, it goes on where it was.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from papers.paper1_rul_varying_speed import femto, life_gap_diagnoses
from papers.paper1_rul_varying_speed.cases import Case, read_case
from papers.paper1_rul_varying_speed.job import Added, Job, train_and_judge
from papers.paper1_rul_varying_speed.life_gap_diagnoses import (
    AFTER_ALARM,
    BEFORE_ALARM,
    SEEN,
    SPEEDS,
    STAGES,
    VARIANT,
    Asked,
    diagnosed,
    target_of,
)
from papers.paper1_rul_varying_speed.life_gap_tables import errors, summary, verdicts
from papers.paper1_rul_varying_speed.models import architecture_of
from papers.paper1_rul_varying_speed.options import CONFIG, Options, read_options
from papers.paper1_rul_varying_speed.training_code import code_of_training
from papers.studies import Count, Progress, command, keep_figures, keep_tables, profile_of
from twingap.data import load
from twingap.provenance import digest_of_code, digest_of_path
from twingap.sweep import sweep

if TYPE_CHECKING:
    import pandas as pd

    from twingap.track import Run

MODELS: Final = ("CNN", "Proposed model 3")


@dataclass(frozen=True)
class Size:
    """How much is run.

    Parameters
    ----------
    bearings : tuple of str
        Of the rig.
    seeds : int
        Trainings per run and model, without and with the named effects.
    steps : int
        Gradient steps of each.
    most_records : int
        Simulated records per training.
    """

    bearings: tuple[str, ...]
    seeds: int
    steps: int
    most_records: int


PROFILES: Final = {
    "smoke": Size(("A154",), 1, 200, 800),
    "full": Size(("A148", "A150", "A153", "A154", "A155", "A156"), 2, 800, 2000),
}
"""Full takes some 20 minutes of one core."""


@dataclass(frozen=True)
class LifeGap:
    """What came out.

    Parameters
    ----------
    tables : dict of str to DataFrame
        life_gap (verdicts), life_gap_rmse (trainings), life_gap_summary.
    computed : int
        Diagnoses and trainings that ran now; the others came from the store.
    """

    tables: dict[str, pd.DataFrame]
    computed: int


def added(row: dict[str, Any]) -> Added | None:
    """Effects of a verdict as part of a training; None when none is named or could be added."""
    if row["refused"] or not row["added"]:
        return None
    return Added(
        tuple((name, tuple(sorted(values.items()))) for name, values in row["added"].items()), float(row["scale"])
    )  # fmt: skip


def trainings_of(case: Case, options: Options, more: Added | None, size: Size) -> Iterator[Job]:
    """Trainings without and with the named effects."""
    chosen = options.variants[VARIANT]
    own = dataclasses.replace(options.training, steps=size.steps, alike=chosen.alike)
    for seed in range(size.seeds):
        for what in (None, more) if more is not None else (None,):
            for model in MODELS:
                shape = architecture_of(model, printed=options.judging.printed)
                yield Job(
                    case.name, VARIANT, model, dataclasses.replace(shape, length=options.target.window_samples), seed,
                    own, chosen.signal, 1, size.most_records, options.judging.criterion, added=what,
                )  # fmt: skip


def questions(bearings: Sequence[str], femto_runs: Sequence[str], seed: int) -> Iterator[Asked]:
    """Every diagnosis: the rig's by stage and speed, each run up to now, FEMTO's by stage and condition."""
    for stage in STAGES:
        for speed in SPEEDS:
            yield Asked("rig", stage, speed, tuple(bearings), seed)
    for bearing in bearings:
        yield Asked("rig", SEEN, "all", (bearing,), seed)
    for condition in sorted({name[len("Bearing")] for name in femto_runs}):
        own = tuple(name for name in femto_runs if name[len("Bearing")] == condition)
        for stage in (BEFORE_ALARM, AFTER_ALARM):
            yield Asked("femto", stage, condition, own, seed)


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> LifeGap:
    """Diagnose and train what is missing; tables, figure.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path, optional
        Data root: the rig is taken unless it holds the paper's own set, FEMTO is left out unless it holds that.
    seed : int
        Of the diagnoses.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables and figures go there as well.
    progress : callable
    config : Path
        The paper's.
    draw : bool
        Make the figure.
    """
    import twingap.gap
    from twingap.gap.knowledge import shipped_digest

    options, size = read_options(config), profile_of(PROFILES, profile, Path(__file__))
    where = None if root is None else str(root)
    target = target_of(options, where, size.bearings)
    cases = {name: read_case(target, name, options.target, options.adaptation) for name in size.bearings}
    femto_runs, data = _femto(where)
    asked = list(questions(size.bearings, femto_runs, seed))
    given: dict[str, Any] = {"store": out / "results", "backend": backend, "address": address}
    answers = sweep(
        functools.partial(diagnosed, root=where, config=str(config)), asked,
        version=code_of_training() + digest_of_code(twingap.gap, femto, life_gap_diagnoses),
        data={"learnt": shipped_digest(), **data, **{name: case.digest for name, case in cases.items()}},
        describe=lambda job: job.words, on_result=Count("diagnoses", len(asked), progress), **given,
    )  # fmt: skip
    told = [(a.job, dict(a.value)) for a in answers]
    named = {job.bearings[0]: added(row) for job, row in told if job.data == "rig" and job.speed == "all"}
    jobs = {name: list(trainings_of(case, options, named[name], size)) for name, case in cases.items()}
    count = Count("trainings", sum(map(len, jobs.values())), progress)
    trained = []
    for name, case in cases.items():
        trained += sweep(
            functools.partial(train_and_judge, case=case), jobs[name],
            data={"run": case.digest, "adaptation": repr(options.adaptation)}, version=code_of_training(),
            describe=lambda j: f"{j.bearing}, {j.model}, seed {j.seed}, {j.added}", on_result=count, **given,
        )  # fmt: skip
    every = errors(target.title, [(r.job, dict(r.value)) for r in trained])
    made = {
        "life_gap": verdicts(target.title, told), "life_gap_rmse": every, "life_gap_summary": summary(every),
    }  # fmt: skip
    keep_tables(made, out, log, target.title)
    if draw:
        from papers.paper1_rul_varying_speed.life_gap_figures import gaps

        keep_figures([("life_gap", gaps(made["life_gap"]))], out, log)
    return LifeGap(made, sum(bool(r.why) for r in answers) + sum(bool(r.why) for r in trained))


def _femto(root: str | None) -> tuple[tuple[str, ...], dict[str, str]]:
    """FEMTO's runs at hand, and the digest of their files."""
    from twingap.data.root import NotAtHandError, data_root

    try:
        return load("femto", root).groups, {"femto": digest_of_path(data_root(root) / "femto")}
    except NotAtHandError:
        return (), {}


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(
        run, "The gap of paper 1's twin by stage of life and speed: tables and a figure.",
        lambda study: {name: study.tables[name] for name in ("life_gap", "life_gap_summary")}, arguments,
        takes=("root", "seed"),
    )  # fmt: skip


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper1_rul_varying_speed.life_gap import main as run_main

    run_main()
