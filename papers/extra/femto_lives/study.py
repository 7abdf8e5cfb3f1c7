"""Study of paper 1's twin on FEMTO's runs: verdicts, errors by twin, what closing the gap is worth."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.extra.femto.jobs import at_hand
from papers.extra.femto_lives import jobs
from papers.extra.life_gap.study import verdict
from papers.figures import rule, subplots
from papers.framework import Rows, Step, Study, Work, as_table
from papers.intervals import compared
from papers.paper1_rul_varying_speed.cases import Case
from papers.paper1_rul_varying_speed.job import Job
from papers.paper1_rul_varying_speed.methods.metrics import rmse

AS_PRINTED, NAMED, CLOSED = "as printed", "named effects added", "closed"
TWINS: Final = (AS_PRINTED, NAMED, CLOSED)


def all_tables(work: Work) -> dict[str, pd.DataFrame]:
    told = {r.job: dict(r.value) for r in work["diagnoses"]}
    every = errors([(one.wait_min, r.job, dict(r.value)) for one, r in work["trained"]])
    cases, refused = work["cases"], work["refused"]
    runs = [(w.bearing, w.wait_min, cases.get(w), told.get(w), refused.get(w, "")) for w in work["wanted"]]
    return {"femto_lives": of_runs(runs), "femto_lives_rmse": every, "femto_lives_summary": summary(every)}


def twin_of(job: Job) -> str:
    if job.added is not None:
        return NAMED
    return AS_PRINTED if job.variant == "printed" else CLOSED


@as_table
def of_runs(asked: Sequence[tuple[str, float, Case | None, dict[str, Any] | None, str]]) -> Rows:
    """A row per run and wait: rows of anomaly, now and end, what the simulated lives alone are off by, the verdict."""
    for bearing, wait, case, told, why in asked:
        line: dict[str, Any] = {"data": "FEMTO", "bearing": bearing, "wait_min": wait}
        if case is None or told is None:
            yield line | {"refused": why}
            continue
        twin, own = case.known.twin, case.minutes(case.mean_of_lives())
        line |= {
            "onset_row": twin.onset_row, "now_row": twin.now_row, "last_row": case.run.time_s.size - 1,
            "lives_rmse_min": rmse(case.true_min, own), "lives_bias_min": float(np.mean(own - case.true_min)),
            "records": told["records"],
        }  # fmt: skip
        yield line | verdict(told)


def errors(results: Sequence[tuple[float, Job, dict[str, Any]]]) -> pd.DataFrame:
    """RMSE (min) of every training: of the checkpoint chosen without labels, and of the one labels would choose."""
    return pd.DataFrame([
        {
            "data": "FEMTO", "bearing": job.bearing, "wait_min": wait, "twin": twin_of(job), "model": job.model,
            "seed": job.seed, "rmse_min": value["rmse_min"][value["place"]], "oracle_min": min(value["rmse_min"]),
        }
        for wait, job, value in results
    ])  # fmt: skip


@as_table
def summary(every: pd.DataFrame) -> Rows:
    """By wait, model and twin: mean RMSE over runs, and its ratio to that of the printed twin with a 90 % interval."""
    for (wait, model), own in every.groupby(["wait_min", "model"], sort=False):
        tables = {
            twin: part.pivot(index="bearing", columns="seed", values="rmse_min") for twin, part in own.groupby("twin")
        }
        before = tables[AS_PRINTED]
        for twin in TWINS[1:]:
            after = tables.get(twin, before.iloc[:0])
            yield {"data": "FEMTO", "wait_min": wait, "model": model, "twin": twin, **compared(before, after)}


MARKS: Final = {AS_PRINTED: ("#D55E00", "o", -0.22), NAMED: ("#0072B2", "s", 0.0), CLOSED: ("#009E73", "^", 0.22)}


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    yield "femto_lives", lives(work.tables["femto_lives_rmse"], work.tables["femto_lives"])


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
        line[0].set_ylabel("RMSE, min")
    for axes in panels[-1]:
        axes.set_xlabel("FEMTO bearing")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=2.4)
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
    tables=all_tables,
    figures=all_figures,
    letters=(12, 10),
    headlines=("femto_lives", "femto_lives_summary"),
)
