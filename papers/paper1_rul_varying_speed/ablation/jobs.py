"""Ablation of proposed model 3: one encoding at a time, on simulated lives and on true ones.

case --as simulated------------------------> lives --+
case --rate of growth nearest to the truth-> lives --+--> DANN, + speed, + sequence, + both; seeds --> ablation, summary

The lives of the second line are an oracle's: their ends lie about the true end, which only a judge knows. They say what
is the network's doing and what the simulated lives' own: labels are the lives', and a model that reads them better is
as wrong as they are.

What full finds best it finds on the six runs that it looks at. Its profile ``confirm`` asks one question, fixed before
anything of that bench was simulated, of six runs of another virtual bench: whether DANN with the speed encoding alone
beats DANN there too, on lives as simulated.
"""

import dataclasses
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from papers.framework import Work
from papers.paper1_rul_varying_speed.cases import Case, Target, load_target, read_case
from papers.paper1_rul_varying_speed.job import Job, job_of, train_and_judge
from papers.paper1_rul_varying_speed.lives import options as of_lives
from papers.paper1_rul_varying_speed.methods.adaptive_twin import Adaptation, NoLifeError, lives_that_may_follow
from papers.paper1_rul_varying_speed.methods.architecture import MODELS, LifeArchitecture, architecture_of
from papers.paper1_rul_varying_speed.methods.metrics import rmse
from twingap import TwingapError

VARIANT: Final = "printed"
SIMULATED, TRUE = "as simulated", "about the true end (oracle)"
DANN: Final = "DANN"
ADVERSARIAL: Final[Mapping[str, LifeArchitecture]] = MappingProxyType({
    DANN: MODELS[DANN],
    "DANN + speed": LifeArchitecture(sequence=False, speed=True, adversarial=True),
    "DANN + sequence": LifeArchitecture(sequence=True, speed=False, adversarial=True),
    "Proposed model 3": MODELS["Proposed model 3"],
})  # fmt: skip
"""From one to the other, an encoding at a time."""
RATES: Final = tuple(float(v) for v in np.geomspace(0.4, 2.5, 121))
"""Times the fitted rate, among which the oracle chooses."""


@dataclass(frozen=True)
class Size(of_lives.Size):
    copies: int
    models: tuple[str, ...] = tuple(ADVERSARIAL)
    lives: tuple[str, ...] = (SIMULATED, TRUE)
    bench: int | None = None


@dataclass(frozen=True)
class Options:
    lives: Path
    profiles: dict[str, Size]


def lives(work: Work) -> of_lives.Options:
    """Configuration of the twin and its trainings, on the profile's bench."""
    options = of_lives.read_options(work.config.parent / work.options.lives)
    if work.size.bench is None:
        return options
    return dataclasses.replace(options, target=dataclasses.replace(options.target, surrogate_seed=work.size.bench))


def target(work: Work) -> Target:
    found = load_target(work["options"].target, work.root, work.size.bearings)
    work.title = found.title
    return found


def rows(work: Work) -> list[dict[str, Any]]:
    """A row for each training; runs of which nothing can be simulated are named in ``work["left out"]``."""
    options, size = work["options"], work.size
    found: list[dict[str, Any]] = []
    left_out: dict[str, str] = {}
    for name in size.bearings:
        try:
            simulated = read_case(work["target"], name, options.target, options.adaptation)
        except NoLifeError as error:  # growth after ten minutes may be so slow that no life ends in sight
            left_out[name] = str(error)
            continue
        for what in size.lives:
            case = simulated if what == SIMULATED else with_true_lives(simulated, options.adaptation)
            trained = work.sweep(
                train_and_judge, trainings_of(case, options, size, work.seed), {"case": (case, case.digest)},
                lambda job: f"{job.bearing}, {job.model}, seed {job.seed}", f"training, {name}, lives {what}",
                data={"adaptation": repr(options.adaptation), "rate": f"{case.known.twin.damage.rate:.12g}"},
            )  # fmt: skip
            found += [_row(work.title, what, case, r.job, dict(r.value)) for r in trained]
    if not found:
        raise TwingapError(f"no run can be trained for: {'; '.join(left_out.values())}", where="ablation")
    work["left out"] = left_out
    return found


def with_true_lives(case: Case, options: Adaptation) -> Case:
    """The case with lives of the rate of growth with which their mean is nearest to the truth: an oracle's."""
    twin = case.known.twin
    seen = case.run.until(twin.now_row)
    found: list[tuple[float, Case]] = []
    for factor in RATES:
        damage = dataclasses.replace(twin.damage, rate=twin.damage.rate * factor)
        try:
            lives, held_out, _ = lives_that_may_follow(seen, twin.influence, damage, options)
        except TwingapError:  # too fast, so that they end before now, or too slow for the speeds looked ahead
            continue
        own = dataclasses.replace(twin, damage=damage, lives=lives, held_out=held_out)
        other = dataclasses.replace(case, known=dataclasses.replace(case.known, twin=own))
        found.append((rmse(other.true_min, other.minutes(other.mean_of_lives())), other))
    if not found:
        raise TwingapError("no rate of growth leads to the run's end", where=f"run {case.name}")
    return min(found, key=lambda pair: pair[0])[1]


def trainings_of(case: Case, options: of_lives.Options, size: Size, seed: int) -> Iterator[Job]:
    """Models innermost: those of a seed share their simulated records."""
    for k, model in itertools.product(range(size.seeds), size.models):
        shape = architecture_of(model, printed=options.judging.printed, models=ADVERSARIAL)
        yield job_of(case, options, VARIANT, model, shape, seed + k, size)


def _row(title: str, lives: str, case: Case, job: Job, value: dict[str, Any]) -> dict[str, Any]:
    true, own = case.true_min, case.minutes(case.mean_of_lives())
    return {
        "data": title, "lives": lives, "bearing": job.bearing, "model": job.model, "seed": job.seed,
        "rmse_min": rmse(true, case.minutes(np.asarray(value["revolutions"]))),
        "bias_min": float(np.mean(case.minutes(np.asarray(value["revolutions"])) - true)),
        "lives_rmse_min": rmse(true, own), "lives_bias_min": float(np.mean(own - true)),
    }  # fmt: skip
