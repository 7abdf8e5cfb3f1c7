"""Study of baselines, configured as the comparison: trials; means by data set, source and method; tests; twins."""

import pandas as pd

from papers.extra.baselines import jobs
from papers.extra.baselines.adaptation import PLAIN, skada_at_hand
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
    """Each method against no adaptation, corrected by Holm within a source, and the population twin against the other
    simulated sources by method, corrected within a data set: sign flips of pairs of task and seed."""
    for (held_out, data), part in rows.groupby(["held_out", "data"], sort=False):
        of = part.pivot_table(index=["task", "seed"], columns=["source", "method"], values="accuracy", sort=False)
        keys: list[tuple[str, str]] = [*of.columns]
        sources = dict.fromkeys(source for source, _ in keys)
        pairs = [(key, (key[0], PLAIN), PLAIN) for key in keys if key[1] != PLAIN]
        families = [[pair for pair in pairs if pair[0][0] == source] for source in sources]
        drawn = [key for key in keys if key[0] == jobs.POPULATION]
        others = [name for name in (jobs.CONTACT, jobs.FLEETS) if name in sources]
        for family in (*families, [(key, (other, key[1]), other) for key in drawn for other in others]):
            about = {"held_out": held_out, "data": data}
            yield from corrected([
                {**about, "source": key[0], "method": key[1], "against": against, **paired(of[key], of[other])[1]}
                for key, other, against in family
            ])  # fmt: skip


@as_table
def twins(work: Work) -> Rows:
    """A row per population twin: states of the recordings that were read right, those of faults with several
    recordings, from which machines are drawn, whether the closest twin has values by recording itself, effects."""
    for task, target in work["tasks"]:
        truth = {str(c.group): c.fault for c in target.records.conditions}
        for (name, unseen), twin in work["twins"].items():
            if name == task.name:
                states = twin["states"]
                found = pd.Series(states.values())
                yield {
                    "data": target.title, "task": name, "unseen": unseen, "recordings": len(states),
                    "states right": sum(truth[group] == state for group, state in states.items()),
                    "of several": ", ".join(found.unique()[found.value_counts(sort=False) > 1]),
                    "closest by recording": twin["by_unit"], "effects": ", ".join(twin["effects"]),
                }  # fmt: skip


STUDY = Study(
    name="baselines",
    title="domain adaptation by skada, and a plain network",
    options=Options,
    steps=(
        Step("tasks", load_tasks),
        Step("twins", jobs.population_twins),
        Step("results", jobs.results),
    ),
    tables={
        "baselines": table,
        "baselines-mean": lambda work: means(work.tables["baselines"]),
        "baselines-tests": lambda work: tests(work.tables["baselines"]),
        "baselines-twins": twins,
    },
    headlines=("baselines-mean",),
    at_hand=skada_at_hand,
)
