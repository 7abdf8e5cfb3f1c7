"""Declaration of the identification study."""

from papers.framework import Step, Study
from papers.paper3_zoa_dann.identification import figures, jobs, tables

STUDY = Study(
    name="identification",
    title="identification of the twin",
    options=jobs.Options,
    check=jobs.check,
    steps=(
        Step("halves", jobs.halves),
        Step("searches", jobs.search, jobs.searches, jobs.fit),
        Step("comparisons", jobs.compare, jobs.comparisons, jobs.both),
        Step("recoveries", jobs.recover, jobs.machines),
    ),
    tables=tables.all_tables,
    figures=figures.all_figures,
    letters=(14, 13),
    headlines=("identification-drops", "identification-recovery"),
)
