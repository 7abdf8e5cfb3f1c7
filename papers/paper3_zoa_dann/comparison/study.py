"""Declaration of the comparison."""

from papers.framework import Step, Study
from papers.paper3_zoa_dann.comparison import figures, jobs, tables

STUDY = Study(
    name="comparison",
    title="nine methods and the analyst's rule",
    options=jobs.Options,
    steps=(Step("tasks", jobs.load_tasks), Step("outcomes", jobs.outcomes)),
    tables=tables.all_tables,
    metrics=tables.metrics,
    figures=figures.all_figures,
    headlines=("comparison-mean", "comparison-published"),
)
