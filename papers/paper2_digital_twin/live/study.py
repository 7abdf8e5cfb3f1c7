"""Declaration of the study of live updating."""

from papers.framework import Step, Study
from papers.paper2_digital_twin.live import figures, jobs, tables

STUDY = Study(
    name="live",
    title="live updating",
    data=tables.DATA,
    options=jobs.Options,
    check=jobs.check,
    steps=(Step("drifting", jobs.live_through, jobs.drifting), Step("steady", jobs.live_through, jobs.steady)),
    tables=tables.all_tables,
    metrics=tables.metrics,
    figures=figures.all_figures,
    headlines=("live-targets", "live-false-alarms"),
)
