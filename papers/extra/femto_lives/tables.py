"""Tables of the twin of lives on FEMTO: runs and verdicts, errors by twin, what closing the gap is worth."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from papers.extra.life_gap.study import verdict
from papers.framework import Rows, Work, as_table
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
