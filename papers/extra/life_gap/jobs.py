"""Study of the gap between this paper's twin and the runs, by stage of life and speed, and of adding the named effects.

run, stage, speeds --> records ------------------------------+
the twin at their speeds and peaks to peak --> simulated ----+--> `twingap.gap` --> verdict: a row of life_gap
records from the anomaly to now, bearing by bearing: named effects --> simulated lives --> trainings: life_gap_rmse

Every simulated record has the speed and the peak to peak of a measured one: how a life goes on is another question,
which table 5 answers. Rows after now are looked at for the verdicts alone; what is added to the twin was named on
records up to now, without labels. FEMTO's runs have no twin of lives here: the phenomenological twin is calibrated to
each stage, and nothing is trained on it.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from papers.extra.life_gap.diagnoses import AFTER_ALARM, BEFORE_ALARM, SEEN, SPEEDS, STAGES, VARIANT, Asked, target_of
from papers.framework import Inputs, Result, Work
from papers.paper1_rul_varying_speed.cases import Case, read_case
from papers.paper1_rul_varying_speed.job import Added, Job, job_of, train_and_judge
from papers.paper1_rul_varying_speed.lives.options import Options as Lives
from papers.paper1_rul_varying_speed.lives.options import Size, read_options
from papers.paper1_rul_varying_speed.methods.architecture import architecture_of
from twingap.data import NotAtHandError, data_root, load
from twingap.gap.knowledge import shipped_digest
from twingap.provenance import digest_of_path

MODELS: Final = ("CNN", "Proposed model 3")


@dataclass(frozen=True)
class Options:
    lives: Path
    profiles: dict[str, Size]


def lives_config(work: Work) -> Path:
    return Path(work.config.parent / work.options.lives)


def lives(work: Work) -> Lives:
    return read_options(lives_config(work))


def root_of(work: Work) -> str | None:
    """The data root, as jobs take it."""
    return None if work.root is None else str(work.root)


def cases(work: Work) -> dict[str, Case]:
    options = work["options"]
    target = target_of(options, root_of(work), work.size.bearings)
    work.title = target.title
    return {name: read_case(target, name, options.target, options.adaptation) for name in work.size.bearings}


def femto(work: Work) -> tuple[tuple[str, ...], dict[str, str]]:
    """FEMTO's runs at hand, and the digest of their files."""
    try:
        runs = load("femto", root_of(work)).groups
        return runs, {"femto": digest_of_path(data_root(work.root) / "femto")}
    except NotAtHandError:
        return (), {}


def asked(work: Work) -> Iterator[Asked]:
    return questions(work.size.bearings, work["femto"][0], work.seed)


def diagnosis_inputs(work: Work) -> Inputs:
    """Where the records are, and the digests of all that a diagnosis reads."""
    read = {"learnt": shipped_digest(), **work["femto"][1]}
    read |= {name: case.digest for name, case in work["cases"].items()}
    config = str(lives_config(work)), repr(work["options"])
    return {"root": (root_of(work), " ".join(read.values())), "config": config}


def trained(work: Work) -> Iterator[Result[Job]]:
    """Trainings without and with the effects that were named on each run."""
    alone = (r for r in work["diagnoses"] if (r.job.data, r.job.speed) == ("rig", "all"))
    named = {r.job.bearings[0]: added(dict(r.value)) for r in alone}
    for name, case in work["cases"].items():
        yield from work.sweep(
            train_and_judge, trainings_of(case, work["options"], named[name], work.size),
            {"case": (case, case.digest)}, lambda j: f"{j.bearing}, {j.model}, seed {j.seed}, {j.added}",
            f"training, {name}", data={"adaptation": repr(work["options"].adaptation)},
        )  # fmt: skip


def added(row: dict[str, Any]) -> Added | None:
    """Effects of a verdict as part of a training; None when none is named or could be added."""
    if row["refused"] or not row["added"]:
        return None
    effects = tuple((name, tuple(sorted(values.items()))) for name, values in row["added"].items())
    return Added(effects, float(row["scale"]))


def trainings_of(case: Case, options: Lives, more: Added | None, size: Size) -> Iterator[Job]:
    """Trainings without and with the named effects."""
    twins = (None, more) if more is not None else (None,)
    for seed, what, model in itertools.product(range(size.seeds), twins, MODELS):
        shape = architecture_of(model, printed=options.judging.printed)
        yield job_of(case, options, VARIANT, model, shape, seed, size, added=what)


def questions(bearings: Sequence[str], femto_runs: Sequence[str], seed: int) -> Iterator[Asked]:
    """Every diagnosis: the rig's by stage and speed, each run up to now, FEMTO's by stage and condition."""
    for stage, speed in itertools.product(STAGES, SPEEDS):
        yield Asked("rig", stage, speed, tuple(bearings), seed)
    for bearing in bearings:
        yield Asked("rig", SEEN, "all", (bearing,), seed)
    for condition in sorted({name[len("Bearing")] for name in femto_runs}):
        own = tuple(name for name in femto_runs if name[len("Bearing")] == condition)
        for stage in (BEFORE_ALARM, AFTER_ALARM):
            yield Asked("femto", stage, condition, own, seed)
