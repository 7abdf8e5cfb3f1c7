"""Tables of the life-gap study: verdicts, errors before and after, and what the difference is worth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from papers.extra.life_gap.diagnoses import Asked
from papers.framework import Rows, Work, as_table
from papers.paper1_rul_varying_speed.job import Job
from twingap.adapt.evaluate import t_interval


def all_tables(work: Work) -> dict[str, pd.DataFrame]:
    every = errors(work.title, [(r.job, dict(r.value)) for r in work["trained"]])
    told = verdicts(work.title, [(r.job, dict(r.value)) for r in work["diagnoses"]])
    return {"life_gap": told, "life_gap_rmse": every, "life_gap_summary": summary(every)}


@as_table
def verdicts(title: str, answers: Sequence[tuple[Asked, dict[str, Any]]]) -> Rows:
    for asked, row in answers:
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
def errors(title: str, results: Sequence[tuple[Job, dict[str, Any]]]) -> Rows:
    """RMSE (min) by run and model without and with the effects; of runs where none was added, both alike."""
    for job, value in results:
        yield {
            "data": title, "bearing": job.bearing, "model": job.model, "seed": job.seed,
            "added": "" if job.added is None else ", ".join(name for name, _ in job.added.effects),
            "rmse_min": value["rmse_min"][value["place"]], "oracle_min": min(value["rmse_min"]),
        }  # fmt: skip


@as_table
def summary(every: pd.DataFrame) -> Rows:
    """Mean RMSE over runs by model, before and after, and the ratio with its 90 % interval over seeds."""
    for model, own in every.groupby("model", sort=False):
        parts = (own[own["added"] == ""], own[own["added"] != ""])
        before, after = (part.pivot(index="bearing", columns="seed", values="rmse_min") for part in parts)
        yield {"data": own["data"].iloc[0], "model": model, **compared(before, after)}


def compared(before: pd.DataFrame, after: pd.DataFrame) -> dict[str, float]:
    """Errors before and after [runs, seeds], min, their ratio with its 90 % interval over seeds, and on how many runs
    it is below 1; runs that `after` lacks count as unchanged."""
    after = after.reindex(index=before.index, columns=before.columns).fillna(before)
    ratios = (after.mean() / before.mean()).to_numpy()
    low, high = t_interval(list(ratios), 0.9)
    return {
        "runs": len(before), "seeds": ratios.size,
        "before_min": before.to_numpy().mean(), "after_min": after.to_numpy().mean(), "ratio": ratios.mean(),
        "low_90": low, "high_90": high, "runs_better": int((after.mean(axis=1) < before.mean(axis=1)).sum()),
    }  # fmt: skip
