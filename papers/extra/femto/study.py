"""Declaration of the study of FEMTO's runs."""

from papers.extra.femto import figures, jobs, tables
from papers.framework import Step, Study

STUDY = Study(
    name="femto",
    title="remaining life of the FEMTO learning bearings",
    data="FEMTO",
    options=jobs.Options,
    at_hand=jobs.at_hand,
    steps=(
        Step("features", jobs.take_features, jobs.bearings, jobs.files),
        Step("runs", jobs.measured),
        Step("predictions", jobs.predict, jobs.predictions, jobs.of_features),
    ),
    tables=tables.all_tables,
    figures=figures.all_figures,
    letters=(12, 10),
    headlines=("femto", "femto_wins"),
)
