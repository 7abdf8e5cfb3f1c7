"""Declaration of the study of fault lines."""

from pathlib import Path

from papers.extra.lines import jobs, tables
from papers.framework import Step, Study

STUDY = Study(
    name="lines",
    title="recordings that show the line of their own fault",
    config=Path(__file__).with_name("config.toml"),
    options=jobs.Options,
    steps=(Step("rows", jobs.rows),),
    tables=tables.all_tables,
    headlines=("lines-told",),
)
