"""Declaration of the study of paper 1's twin on FEMTO's runs."""

from papers.extra.femto.jobs import at_hand
from papers.extra.femto_lives import figures, jobs, tables
from papers.framework import Step, Study

STUDY = Study(
    name="femto_lives",
    title="the twin of lives on FEMTO's runs",
    data="FEMTO",
    options=jobs.Options,
    at_hand=at_hand,
    steps=(
        Step("wanted", jobs.wanted),
        Step("cases", jobs.cases),
        Step("diagnoses", jobs.diagnosed, lambda work: list(work["cases"]), jobs.inputs, lambda job: job.words),
        Step("trained", jobs.trained),
    ),
    tables=tables.all_tables,
    figures=figures.all_figures,
    letters=(12, 10),
    headlines=("femto_lives", "femto_lives_summary"),
)
