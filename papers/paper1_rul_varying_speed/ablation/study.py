"""Study of the ablation, and its tables: errors by lives, bearing and model; by lives and model beside DANN's."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from papers.framework import Step, Study, Work
from papers.intervals import by_seed, compared
from papers.paper1_rul_varying_speed.ablation import jobs


def all_tables(work: Work) -> dict[str, pd.DataFrame]:
    """Every table by name; the last only where no life of some run could be simulated."""
    made = tables_of(work["rows"])
    if work["left out"]:
        about = [{"data": work.title, "bearing": name, "why": why} for name, why in work["left out"].items()]
        made["ablation_left_out"] = pd.DataFrame(about)
    return made


def tables_of(rows: Sequence[dict[str, Any]]) -> dict[str, pd.DataFrame]:
    """Errors by lives, bearing and model over seeds; and by lives and model over bearings, beside DANN's."""
    every = pd.DataFrame(rows)
    by_bearing = every.groupby(["data", "lives", "bearing", "model"], sort=False).agg(
        seeds=("seed", "size"), rmse_min=("rmse_min", "mean"), std=("rmse_min", "std"), bias_min=("bias_min", "mean"),
        lives_rmse_min=("lives_rmse_min", "mean"), lives_bias_min=("lives_bias_min", "mean"),
    ).reset_index()  # fmt: skip
    summary = []
    for (data, lives), own in every.groupby(["data", "lives"], sort=False):
        for model, part in own.groupby("model", sort=False):
            found = compared(by_seed(own[own["model"] == jobs.DANN]), by_seed(part))
            summary.append({
                "data": data, "lives": lives, "model": model, "seeds": found["seeds"], "rmse_min": found["after_min"],
                "lives_rmse_min": own.groupby("bearing")["lives_rmse_min"].first().mean(), "over_dann": found["ratio"],
                "low_90": found["low_90"], "high_90": found["high_90"], "bearings": found["runs"],
                "better_than_dann": found["runs_better"],
            })  # fmt: skip
    return {"ablation": by_bearing, "ablation_summary": pd.DataFrame(summary)}


STUDY = Study(
    name="ablation",
    title="adversarial models, an encoding at a time",
    options=jobs.Options,
    steps=(Step("options", jobs.lives), Step("target", jobs.target), Step("rows", jobs.rows)),
    tables=all_tables,
    headlines=("ablation", "ablation_summary"),
)
