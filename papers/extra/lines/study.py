"""Declaration of the study of fault lines."""

from papers.extra.lines import jobs, tables
from papers.framework import Step, Study

STUDY = Study(
    name="lines",
    title="recordings that show the line of their own fault",
    options=jobs.Options,
    steps=(Step("rows", jobs.rows),),
    tables=tables.all_tables,
    headlines=("lines-told",),
)
