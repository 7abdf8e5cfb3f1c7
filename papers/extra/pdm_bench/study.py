"""Study of pdm-bench's scenarios, and its tables: what was at hand, every trial, means over seeds."""

import pandas as pd

from papers.extra.baselines.adaptation import skada_at_hand
from papers.extra.pdm_bench import jobs
from papers.framework import Rows, Step, Study, Work, as_table

MEASURES = ["accuracy", "oracle", "macro_f1", "auroc", "recordings"]


def trials(work: Work) -> pd.DataFrame:
    """A row per method, source and seed."""
    return pd.DataFrame(
        {
            "scenario": own.job.scenario, "source": own.job.source, "features": own.job.view, "method": method,
            "seed": own.job.seed, **{name: value[name] for name in MEASURES}, "setting": value["setting"],
        }
        for own in work["results"]
        for method, value in own.value.items()
    )  # fmt: skip


def means(rows: pd.DataFrame) -> pd.DataFrame:
    """Means over seeds, with the deviation of the accuracy."""
    grouped = rows.groupby(["scenario", "source", "features", "method"], sort=False)
    return grouped[MEASURES].mean().assign(accuracy_std=grouped["accuracy"].std()).reset_index()


@as_table
def scenarios(work: Work) -> Rows:
    """A row per scenario: recordings at hand and those of pdm-bench, windows, and the share of the largest class."""
    for own in work["splits"]:
        train, judge, _ = work["rows"][own.name]
        teach, judged = own.scenario.published
        yield {
            "scenario": own.name, "data": jobs.TITLES[own.records.name], "classes": ", ".join(own.classes),
            "teach": len(own.train), "of published": teach, "windows that teach": len(train["label"]),
            "judged": len(own.judge), "of published judged": judged, "windows judged": len(judge["label"]),
            "largest class": pd.Series(judge["label"]).value_counts(normalize=True).max(),
        }  # fmt: skip


STUDY = Study(
    name="pdm_bench",
    title="frozen scenarios of pdm-bench",
    options=jobs.Options,
    steps=(Step("splits", jobs.load_splits), Step("rows", jobs.read_rows), Step("results", jobs.results)),
    tables={
        "pdm_bench-scenarios": scenarios,
        "pdm_bench": trials,
        "pdm_bench-mean": lambda work: means(work.tables["pdm_bench"]),
    },
    headlines=("pdm_bench-scenarios", "pdm_bench-mean"),
    at_hand=skada_at_hand,
)
