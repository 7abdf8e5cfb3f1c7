"""Declaration of the study of the gap of paper 1's twin."""

from papers.extra.life_gap import diagnoses, figures, jobs, tables
from papers.framework import Step, Study

STUDY = Study(
    name="life_gap",
    title="gap of the twin of lives",
    options=jobs.Options,
    steps=(
        Step("options", jobs.lives),
        Step("cases", jobs.cases),
        Step("femto", jobs.femto),
        Step("diagnoses", diagnoses.diagnosed, jobs.asked, jobs.diagnosis_inputs, lambda job: job.words),
        Step("trained", jobs.trained),
    ),
    tables=tables.all_tables,
    figures=figures.all_figures,
    letters=(12, 10),
    headlines=("life_gap", "life_gap_summary"),
)
