"""Declaration of the study of lives."""

from papers.framework import Step, Study
from papers.paper1_rul_varying_speed.lives import figures, jobs, options, tables

STUDY = Study(
    name="lives",
    title="RMSE of remaining time, minutes",
    options=options.Options,
    steps=(Step("target", jobs.target), Step("results", jobs.results)),
    tables=tables.all_tables,
    figures=figures.all_figures,
    letters=(12, 10),
    headlines=("errors",),
    columns={"errors": ("twin", "bearing", "model", "seeds", "rmse_min", "std")},
)
