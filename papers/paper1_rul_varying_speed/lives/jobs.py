"""Remaining life by five models on every run, five seeds each: tables 3 and 5 and figures 3 to 14.

Smart Maintenance set, or virtual rig --> cases --> twin, up to now --> simulated lives --> five models x seeds
                                                                                                    |
                                tables, figures <-- judged on the run to its end <-- chosen without labels
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING

from papers.paper1_rul_varying_speed.cases import Case, Target, load_target, read_case
from papers.paper1_rul_varying_speed.job import CaseResult, Job, job_of, train_and_judge
from papers.paper1_rul_varying_speed.lives.options import Options, Profile
from papers.paper1_rul_varying_speed.methods.architecture import architecture_of

if TYPE_CHECKING:
    from papers.framework import Work


def target(work: Work) -> Target:
    def made(what: str, fraction: float) -> None:
        work.progress(f"virtual rig, {what}: {100 * fraction:.0f} %", 0, 1)

    found = load_target(work.options.target, work.root, work.size.bearings, made)
    work.title = found.title
    return found


def results(work: Work) -> list[CaseResult]:
    """Every run with every twin."""
    options, size = work.options, work.size
    found: list[CaseResult] = []
    for name in size.bearings:
        case = read_case(work["target"], name, options.target, options.adaptation)
        work.log.data(f"run {name}", case.digest, role="target", source=work.title)
        trainings = work.sweep(
            train_and_judge, _jobs(case, options, size, work.seed), {"case": (case, case.digest)},
            lambda j: f"{j.bearing}, {j.variant} twin, {j.model}, seed {j.seed}", f"training, {name}",
            data={"adaptation": repr(options.adaptation)},
        )  # fmt: skip
        found += [CaseResult(case, own, [t for t in trainings if t.job.variant == own]) for own in size.variants]
    return found


def _jobs(case: Case, options: Options, sizes: Profile, seed: int) -> Iterator[Job]:
    """Models innermost: those of a twin and seed share their simulated records."""
    for variant, i, model in itertools.product(sizes.variants, range(sizes.seeds), sizes.models):
        shape = architecture_of(model, printed=options.judging.printed)
        yield job_of(case, options, variant, model, shape, seed + i, sizes, embedded=i == 0)
