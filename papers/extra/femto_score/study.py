"""Declaration of the study of the challenge's score."""

from papers.extra.femto.jobs import at_hand, files
from papers.extra.femto_score import jobs, tables
from papers.framework import Step, Study

STUDY = Study(
    name="femto_score",
    title="score of the PHM 2012 challenge on the FEMTO learning bearings",
    data="FEMTO",
    options=jobs.Options,
    at_hand=lambda root: at_hand(root, 6),
    steps=(
        Step("measure", jobs.measure, jobs.bearings, files),
        Step("runs", jobs.measured),
        Step("cuts", jobs.cuts_of),
        Step("follow", jobs.follow, jobs.growths, jobs.of_runs),
        Step("grown", jobs.grown),
        Step("predict", jobs.predict, jobs.predictions, jobs.of_growth),
    ),
    tables=tables.all_tables,
    headlines=("femto_score", "femto_score_bounds", "femto_score_lives"),
)
