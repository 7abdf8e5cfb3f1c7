"""Study of the gap of paper 1's twin, and its tables: verdicts, errors before and after, worth of the difference."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.extra.life_gap import diagnoses, jobs
from papers.extra.life_gap.diagnoses import Asked
from papers.figures import rule, subplots
from papers.framework import Result, Rows, Step, Study, Work, as_table
from papers.intervals import by_seed, compared


@as_table
def verdicts(title: str, diagnoses: Sequence[Result[Asked]]) -> Rows:
    for r in diagnoses:
        asked, row = r.job, r.value
        line: dict[str, Any] = {
            "data": title if asked.data == "rig" else "FEMTO",
            "bearings": asked.bearings[0] if len(asked.bearings) == 1 else f"{len(asked.bearings)} bearings",
            "stage": asked.stage, "speed": asked.speed, "records": row["records"],
        }  # fmt: skip
        yield line | verdict(row) | ({} if row["refused"] else {"where": "; ".join(row["where"])})


def verdict(row: dict[str, Any]) -> dict[str, Any]:
    """Columns of a verdict; of a diagnosis that was refused, why."""
    if row["refused"]:
        return {"verdict": row["refused"]}
    ends = row["closure_ci"] or (np.nan, np.nan)
    return {
        "verdict": row["status"], "p_value": row["p_value"], "effects": ", ".join(row["effects"]),
        "gap_before": row["before"], "gap_after": row["after"], "floor": row["floor"],
        "closure": np.nan if row["closure"] is None else row["closure"], "closure_low": ends[0],
        "closure_high": ends[1],
    }  # fmt: skip


@as_table
def errors(work: Work) -> Rows:
    """RMSE (min) by run and model without and with the effects; of runs where none was added, both alike."""
    for r in work["trained"]:
        yield {
            "data": work.title, "bearing": r.job.bearing, "model": r.job.model, "seed": r.job.seed,
            "added": "" if r.job.added is None else ", ".join(name for name, _ in r.job.added.effects),
            "rmse_min": r.value["rmse_min"][r.value["place"]], "oracle_min": min(r.value["rmse_min"]),
        }  # fmt: skip


@as_table
def summary(every: pd.DataFrame) -> Rows:
    """Mean RMSE over runs by model, before and after, and the ratio with its 90 % interval over seeds."""
    for model, own in every.groupby("model", sort=False):
        before, after = (by_seed(part) for part in (own[own["added"] == ""], own[own["added"] != ""]))
        yield {"data": own["data"].iloc[0], "model": model, **compared(before, after)}


BEFORE, AFTER = "#D55E00", "#0072B2"


def gaps(told: pd.DataFrame) -> Figure:
    """A panel per data set, a group per stage: the gap as it is, with the named effects, and its floor."""
    sets = [own for _, own in told[told["gap_before"].notna()].groupby("data", sort=False)]
    count = max(len(sets), 1)
    figure, panels = subplots((6.4 * count, 4.8), 1, count, squeeze=False)
    for axes, own in zip(panels[0], sets, strict=False):
        several = own[own["speed"] != "all"]  # those of single runs have no place on the axis
        stages = [stage for _, stage in several.groupby("stage", sort=False)]
        grouped = pd.concat(stages)
        x: list[float] = []
        for stage in stages:
            begin = x[-1] + 2 if x else 0
            x += [begin + k for k in range(len(stage))]
            axes.text(
                begin + (len(stage) - 1) / 2, 1.01, stage["stage"].iloc[0], transform=axes.get_xaxis_transform(),
                ha="center", va="bottom",
            )  # fmt: skip
        at = np.array(x)
        axes.vlines(at, grouped["gap_after"], grouped["gap_before"], color="0.75", lw=2)
        axes.plot(at, grouped["gap_before"], "o", color=BEFORE, ms=9, label="as it is")
        axes.plot(at, grouped["gap_after"], "s", color=AFTER, ms=8, mfc="none", mew=2, label="effects added")
        axes.plot(at, grouped["floor"], "_", color="0.2", ms=16, mew=2, label="floor: records against records")
        axes.set_xticks(at, [f"cond. {w}" if w.isdigit() else w.replace("middle", "mid") for w in grouped["speed"]])
        axes.set_ylim(bottom=0)
        axes.set_ylabel("overall gap")
        axes.set_xlabel(grouped["data"].iloc[0], labelpad=8)
        rule(axes, "y")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


STUDY = Study(
    name="life_gap",
    title="gap of the twin of lives",
    options=jobs.Options,
    steps=(
        Step("options", jobs.lives),
        Step("cases", jobs.cases),
        Step("femto", jobs.femto),
        Step("diagnoses", diagnoses.diagnosed, jobs.asked, jobs.diagnosis_inputs, lambda job: job.words),
        Step("trained", jobs.trained),
    ),
    tables={
        "life_gap": lambda work: verdicts(work.title, work["diagnoses"]),
        "life_gap_rmse": errors,
        "life_gap_summary": lambda work: summary(work.tables["life_gap_rmse"]),
    },
    figures={"life_gap": lambda work: gaps(work.tables["life_gap"])},
    letters=(12, 10),
    headlines=("life_gap", "life_gap_summary"),
)
