"""Ablation of proposed model 3: one encoding at a time, on simulated lives and on true ones.

case --as simulated------------------------> lives --+
case --rate of growth nearest to the truth-> lives --+--> DANN, + speed, + sequence, + both; seeds --> ablation, summary

The lives of the second line are an oracle's: their ends lie about the true end, which only a judge knows. They say what
is the network's doing and what the simulated lives' own: labels are the lives', and a model that reads them better is
as wrong as they are.

What full finds best it finds on the six runs that it looks at. Its profile ``confirm`` asks one question, fixed before
anything of that bench was simulated, of six runs of another virtual bench: whether DANN with the speed encoding alone
beats DANN there too, on lives as simulated.

Run as a part of the paper (``twingap run paper1 --profile full``), or alone:
``python -m papers.paper1_rul_varying_speed.ablation --profile full --out DIR``; interrupted, it goes on where it was.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from papers.paper1_rul_varying_speed.cases import Case, load_target, read_case
from papers.paper1_rul_varying_speed.job import Job, train_and_judge
from papers.paper1_rul_varying_speed.methods.adaptive_twin import Adaptation, NoLifeError, lives_that_may_follow
from papers.paper1_rul_varying_speed.methods.architecture import PRINTED_STRIDES, LifeArchitecture
from papers.paper1_rul_varying_speed.methods.metrics import rmse
from papers.paper1_rul_varying_speed.models import MODELS
from papers.paper1_rul_varying_speed.options import CONFIG, Options, read_options
from papers.paper1_rul_varying_speed.training_code import code_of_training
from papers.studies import Count, Progress, command, keep_tables, profile_of
from twingap.errors import TwingapError
from twingap.sweep import sweep

if TYPE_CHECKING:
    import pandas as pd

    from twingap.track import Run

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
class Size:
    """How much is run.

    Parameters
    ----------
    bearings : tuple of str
    seeds : int
        Trainings per run, lives and model.
    steps : int
        Gradient steps of each.
    copies : int
        Records simulated per row of a life.
    most_records : int
        Simulated records per training.
    models : tuple of str
        Of `ADVERSARIAL`; DANN, with which all are compared, among them.
    lives : tuple of str
        `SIMULATED`, `TRUE`.
    bench : int or None
        Seed of the virtual rig where that stands in; None = the configuration's.
    """

    bearings: tuple[str, ...]
    seeds: int
    steps: int
    copies: int
    most_records: int
    models: tuple[str, ...] = tuple(ADVERSARIAL)
    lives: tuple[str, ...] = (SIMULATED, TRUE)
    bench: int | None = None


BEARINGS: Final = ("A148", "A150", "A153", "A154", "A155", "A156")
PROFILES: Final = {
    "smoke": Size(("A154",), 1, 200, 1, 800),
    "full": Size(BEARINGS, 5, 1500, 2, 3000),
    "confirm": Size(BEARINGS, 3, 1500, 2, 3000, (DANN, "DANN + speed"), (SIMULATED,), bench=11),
}
"""full trains as the paper's table 5 does: 240 networks, two hours of one core (30 of ``confirm`` took 28 s each), or
three minutes of an H100 shared by 16 processes."""


@dataclass(frozen=True)
class Ablation:
    """What came out.

    Parameters
    ----------
    tables : dict of str to DataFrame
        ablation (by lives, bearing and model), ablation_summary; ablation_left_out where no life could be simulated.
    computed : int
        Trainings that ran now; the others came from the store.
    """

    tables: dict[str, pd.DataFrame]
    computed: int


def with_true_lives(case: Case, options: Adaptation) -> Case:
    """The case with lives of the rate of growth with which their mean is nearest to the truth: an oracle's.

    Parameters
    ----------
    case : Case
    options : Adaptation

    Raises
    ------
    TwingapError
        When no rate gives lives that end after now.
    """
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


def trainings_of(case: Case, options: Options, size: Size, seed: int) -> Iterator[Job]:
    """Models innermost: those of a seed share their simulated records."""
    chosen = options.variants[VARIANT]
    own = dataclasses.replace(options.training, steps=size.steps, alike=chosen.alike)
    for k in range(size.seeds):
        for model in size.models:
            shape = ADVERSARIAL[model]
            if options.judging.printed:
                shape = dataclasses.replace(shape, strides=PRINTED_STRIDES)
            yield Job(
                case.name, VARIANT, model, dataclasses.replace(shape, length=options.target.window_samples), seed + k,
                own, chosen.signal, size.copies, size.most_records, options.judging.criterion,
            )  # fmt: skip


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
) -> Ablation:
    """Train what is missing; tables.

    Parameters
    ----------
    profile : {"smoke", "full", "confirm"}
    out : Path
        Folder for ``tables/`` and ``results/``.
    root : Path, optional
        Data root: the rig is taken unless it holds the paper's own set.
    seed : int
        First of the seeds.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables go there as well.
    progress : callable
    config : Path
        The paper's.
    draw : bool
        Without effect: there is no figure.
    """
    import pandas as pd

    options, size = read_options(config), profile_of(PROFILES, profile, Path(__file__))
    if size.bench is not None:
        options = dataclasses.replace(options, target=dataclasses.replace(options.target, surrogate_seed=size.bench))
    target = load_target(options.target, root, size.bearings)
    trainings = len(size.bearings) * len(size.lives) * size.seeds * len(size.models)
    count = Count("trainings", trainings, progress)
    rows: list[dict[str, Any]] = []
    computed = 0
    left_out: dict[str, str] = {}
    for name in size.bearings:
        try:
            simulated = read_case(target, name, options.target, options.adaptation)
        except NoLifeError as error:  # growth after ten minutes may be so slow that no life ends in sight
            left_out[name] = str(error)
            continue
        for what in size.lives:
            case = simulated if what == SIMULATED else with_true_lives(simulated, options.adaptation)
            trained = sweep(
                functools.partial(train_and_judge, case=case), list(trainings_of(case, options, size, seed)),
                data={
                    "run": case.digest, "adaptation": repr(options.adaptation),
                    "rate": f"{case.known.twin.damage.rate:.12g}",
                },
                version=code_of_training(),
                describe=functools.partial(_words, what),
                on_result=count, backend=backend, address=address, store=out / "results",
            )  # fmt: skip
            computed += sum(bool(r.why) for r in trained)
            rows += [_row(target.title, what, case, r.job, dict(r.value)) for r in trained]
    if not rows:
        raise TwingapError(f"no run can be trained for: {'; '.join(left_out.values())}", where="ablation")
    made = tables(rows)
    if left_out:
        about = [{"data": target.title, "bearing": name, "why": why} for name, why in left_out.items()]
        made["ablation_left_out"] = pd.DataFrame(about)
    keep_tables(made, out, log, target.title)
    return Ablation(made, computed)


def _words(lives: str, job: Job) -> str:
    return f"{job.bearing}, lives {lives}, {job.model}, seed {job.seed}"


def _row(title: str, lives: str, case: Case, job: Job, value: dict[str, Any]) -> dict[str, Any]:
    true, own = case.true_min, case.minutes(case.mean_of_lives())
    return {
        "data": title, "lives": lives, "bearing": job.bearing, "model": job.model, "seed": job.seed,
        "rmse_min": rmse(true, case.minutes(np.asarray(value["revolutions"]))),
        "bias_min": float(np.mean(case.minutes(np.asarray(value["revolutions"])) - true)),
        "lives_rmse_min": rmse(true, own), "lives_bias_min": float(np.mean(own - true)),
    }  # fmt: skip


def tables(rows: Sequence[dict[str, Any]]) -> dict[str, pd.DataFrame]:
    """Errors by lives, bearing and model over seeds; and by lives and model over bearings, beside DANN's.

    Parameters
    ----------
    rows : sequence of dict
        One of each training.
    """
    import pandas as pd

    from twingap.adapt.evaluate import t_interval

    every = pd.DataFrame(rows)
    by_bearing = every.groupby(["data", "lives", "bearing", "model"], sort=False).agg(
        seeds=("seed", "size"), rmse_min=("rmse_min", "mean"), std=("rmse_min", "std"), bias_min=("bias_min", "mean"),
        lives_rmse_min=("lives_rmse_min", "mean"), lives_bias_min=("lives_bias_min", "mean"),
    ).reset_index()  # fmt: skip
    summary = []
    for (data, lives), own in every.groupby(["data", "lives"], sort=False):
        errors = {
            model: part.pivot(index="bearing", columns="seed", values="rmse_min")
            for model, part in own.groupby("model", sort=False)
        }
        dann = errors[DANN]
        for model, part in errors.items():
            ratios = (part.mean() / dann.mean()).to_numpy()
            low, high = t_interval(list(ratios), 0.9)
            summary.append({
                "data": data, "lives": lives, "model": model, "seeds": ratios.size, "rmse_min": part.to_numpy().mean(),
                "lives_rmse_min": own.groupby("bearing")["lives_rmse_min"].first().mean(), "over_dann": ratios.mean(),
                "low_90": low, "high_90": high, "bearings": len(part),
                "better_than_dann": int((part.mean(axis=1) < dann.mean(axis=1)).sum()),
            })  # fmt: skip
    return {"ablation": by_bearing, "ablation_summary": pd.DataFrame(summary)}


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(
        run, "Paper 1's adversarial models, an encoding at a time, on lives as simulated and about the true end.",
        lambda study: study.tables, arguments, takes=("root", "seed"),
    )  # fmt: skip


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper1_rul_varying_speed.ablation import main as run_main

    run_main()
