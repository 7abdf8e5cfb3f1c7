"""Study of shallow baselines, configured as the comparison: trials; means by data set, source and method; tests."""

from importlib.util import find_spec

import pandas as pd

from papers.extra.baselines import jobs
from papers.framework import Rows, Step, Study, Work, as_table
from papers.paper3_zoa_dann.comparison.jobs import Options, load_tasks
from papers.paper3_zoa_dann.significance import corrected, paired

MEASURES = ("accuracy", "oracle", "macro_f1", "auroc")
CELL = ["held_out", "data", "source", "method"]


@as_table
def table(work: Work) -> Rows:
    """A row per trial and held-out unit: recordings (all windows), bearings (those of bearings not adapted to)."""
    for data, own in work["results"]:
        job = own.job
        for method, value in own.value.items():
            about = {"data": data, "task": job.task, "source": job.source, "method": method, "seed": job.seed}
            # Tasks B leave bearings out in every trial; tasks A in trials of their own.
            parts = {"recordings": value} if job.unseen is None or job.task.startswith("B") else {}
            parts |= {"bearings": value["unseen"]} if value["unseen"] else {}
            for held_out, values in parts.items():
                measured = {name: values[name] for name in MEASURES}
                yield about | {"held_out": held_out} | measured | {"setting": value["setting"]}


@as_table
def means(rows: pd.DataFrame) -> Rows:
    """Means over tasks and seeds, with the deviation over seeds of the mean over tasks."""
    for cell, own in rows.groupby(CELL, sort=False):
        spread = own.groupby("seed")["accuracy"].mean().std()
        measured = {name: own[name].mean() for name in MEASURES}
        yield {**dict(zip(CELL, cell, strict=True)), "trials": len(own), **measured, "accuracy_std": spread}


@as_table
def tests(rows: pd.DataFrame) -> Rows:
    """Each method against none, by pairs of task and seed: sign flips, corrected by Holm within a source."""
    for (held_out, data, source), own in rows.groupby(["held_out", "data", "source"], sort=False):
        pairs = own.pivot_table(index=["task", "seed"], columns="method", values="accuracy", sort=False)
        about = {"held_out": held_out, "data": data, "source": source}
        methods = [name for name in pairs.columns if name != jobs.PLAIN]
        yield from corrected([about | {"method": name} | paired(pairs[name], pairs[jobs.PLAIN])[1] for name in methods])


STUDY = Study(
    name="baselines",
    title="shallow domain adaptation by skada",
    options=Options,
    steps=(Step("tasks", load_tasks), Step("results", jobs.results)),
    tables={
        "baselines": table,
        "baselines-mean": lambda work: means(work.tables["baselines"]),
        "baselines-tests": lambda work: tests(work.tables["baselines"]),
    },
    headlines=("baselines-mean",),
    at_hand=lambda root: find_spec("skada") is not None,
)
