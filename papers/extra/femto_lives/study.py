"""Study of paper 1's twin on FEMTO's runs: verdicts, errors by twin, what closing the gap is worth."""

from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.extra.femto.jobs import at_hand
from papers.extra.femto_lives import jobs
from papers.extra.life_gap.study import verdict
from papers.figures import name_axes, rule, subplots
from papers.framework import Rows, Step, Study, Work, as_table
from papers.intervals import by_seed, compared
from papers.paper1_rul_varying_speed.job import Job
from papers.paper1_rul_varying_speed.methods.metrics import rmse

AS_PRINTED, NAMED, CLOSED = "as printed", "named effects added", "closed"
TWINS: Final = (AS_PRINTED, NAMED, CLOSED)


def twin_of(job: Job) -> str:
    if job.added is not None:
        return NAMED
    return AS_PRINTED if job.variant == "printed" else CLOSED


@as_table
def of_runs(work: Work) -> Rows:
    """A row per run and wait: rows of anomaly, now and end, what the simulated lives alone are off by, the verdict."""
    diagnoses = {r.job: r.value for r in work["diagnoses"]}
    for wanted in work["wanted"]:
        line: dict[str, Any] = {"data": "FEMTO", "bearing": wanted.bearing, "wait_min": wanted.wait_min}
        if wanted in work["refused"]:
            yield line | {"refused": work["refused"][wanted]}
            continue
        case, told = work["cases"][wanted], diagnoses[wanted]
        twin, own = case.known.twin, case.minutes(case.mean_of_lives())
        line |= {
            "onset_row": twin.onset_row, "now_row": twin.now_row, "last_row": case.run.time_s.size - 1,
            "lives_rmse_min": rmse(case.true_min, own), "lives_bias_min": float(np.mean(own - case.true_min)),
            "records": told["records"],
        }  # fmt: skip
        yield line | verdict(told)


@as_table
def errors(work: Work) -> Rows:
    """RMSE (min) of every training: of the checkpoint chosen without labels, and of the one labels would choose."""
    for wanted, r in work["trained"]:
        yield {
            "data": "FEMTO", "bearing": r.job.bearing, "wait_min": wanted.wait_min, "twin": twin_of(r.job),
            "model": r.job.model, "seed": r.job.seed, "rmse_min": r.value["rmse_min"][r.value["place"]],
            "oracle_min": min(r.value["rmse_min"]),
        }  # fmt: skip


@as_table
def summary(every: pd.DataFrame) -> Rows:
    """By wait, model and twin: mean RMSE over runs, and its ratio to that of the printed twin with a 90 % interval."""
    for (wait, model), own in every.groupby(["wait_min", "model"], sort=False):
        printed, *others = (by_seed(own[own["twin"] == twin]) for twin in TWINS)
        for twin, errors in zip(TWINS[1:], others, strict=True):
            yield {"data": "FEMTO", "wait_min": wait, "model": model, "twin": twin, **compared(printed, errors)}


MARKS: Final = {AS_PRINTED: ("#D55E00", "o", -0.22), NAMED: ("#0072B2", "s", 0.0), CLOSED: ("#009E73", "^", 0.22)}


def lives(every: pd.DataFrame, runs: pd.DataFrame) -> Figure:
    """A row of panels per wait, a panel per model: RMSE of each run by twin, seeds as whiskers from least to most."""
    waits, models = list(dict.fromkeys(every["wait_min"])), list(dict.fromkeys(every["model"]))
    figure, panels = subplots(
        (5.6 * len(models) + 1, 3.7 * len(waits) + 0.8), len(waits), len(models), squeeze=False, sharey="row"
    )
    for line, wait in zip(panels, waits, strict=True):
        known = runs[(runs["wait_min"] == wait) & runs["lives_rmse_min"].notna()]
        at = np.arange(len(known))
        for axes, model in zip(line, models, strict=True):
            own = every[(every["wait_min"] == wait) & (every["model"] == model)]
            for twin, (colour, mark, aside) in MARKS.items():
                seeds = own[own["twin"] == twin].groupby("bearing")["rmse_min"]
                mean, least, most = (
                    s.reindex(known["bearing"]).to_numpy() for s in (seeds.mean(), seeds.min(), seeds.max())
                )
                axes.vlines(at + aside, least, most, color=colour, lw=2)
                axes.plot(at + aside, mean, mark, color=colour, ms=8, label=twin)
            axes.plot(at, known["lives_rmse_min"], "_", color="0.2", ms=26, mew=2, label="simulated lives, no network")
            axes.set_xticks(at, [name.removeprefix("Bearing") for name in known["bearing"]])
            axes.set_xlim(-0.6, len(known) - 0.4)
            axes.set_ylim(bottom=0)
            axes.set_title(f"{model}, {wait:g} min after the alarm")
            rule(axes, "y")
    name_axes(panels, "FEMTO bearing", "RMSE, min")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, handlelength=2.4)
    return figure


STUDY = Study(
    name="femto_lives",
    title="the twin of lives on FEMTO's runs",
    data="FEMTO",
    options=jobs.Options,
    at_hand=at_hand,
    steps=(
        Step("wanted", jobs.wanted),
        Step("cases", jobs.cases),
        Step("diagnoses", jobs.diagnosed, lambda work: list(work["cases"]), jobs.inputs, lambda job: job.words),
        Step("trained", jobs.trained),
    ),
    tables={
        "femto_lives": of_runs,
        "femto_lives_rmse": errors,
        "femto_lives_summary": lambda work: summary(work.tables["femto_lives_rmse"]),
    },
    figures={"femto_lives": lambda work: lives(work.tables["femto_lives_rmse"], work.tables["femto_lives"])},
    letters=(12, 10),
    headlines=("femto_lives", "femto_lives_summary"),
)
