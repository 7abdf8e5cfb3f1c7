"""Declaration of the study of live updating."""

from pathlib import Path

from papers.framework import Step, Study
from papers.paper2_digital_twin.live import figures, jobs, tables

STUDY = Study(
    name="live",
    title="live updating",
    data=tables.DATA,
    config=Path(__file__).with_name("config.toml"),
    options=jobs.Options,
    check=jobs.check,
    steps=(Step("drifting", jobs.live_through, jobs.drifting), Step("steady", jobs.live_through, jobs.steady)),
    tables=tables.all_tables,
    metrics=tables.metrics,
    figures=figures.all_figures,
    headlines=("live-targets", "live-false-alarms"),
)
