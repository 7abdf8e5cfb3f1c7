"""Declaration of the study of paper 1's twin on FEMTO's runs."""

from papers.extra.femto.jobs import at_hand
from papers.extra.femto_lives import figures, jobs, tables
from papers.framework import Step, Study
from papers.paper1_rul_varying_speed.lives.figures import STYLE

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
    style=STYLE,
    headlines=("femto_lives", "femto_lives_summary"),
)
