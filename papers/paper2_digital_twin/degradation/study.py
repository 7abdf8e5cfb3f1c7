"""Declaration of the degradation study."""

from papers.framework import Step, Study
from papers.paper2_digital_twin.degradation import figures, jobs, tables
from papers.paper2_digital_twin.degradation.candidates import judge_all

STUDY = Study(
    name="degradation",
    title="degradation curves",
    options=jobs.Options,
    steps=(
        Step("runs", jobs.runs),
        Step("judged", lambda work: judge_all(work["runs"], work.options.indicators)),
        Step("analyses", jobs.analyse, jobs.analyses, jobs.series),
        Step("coverage", jobs.cover, jobs.checks),
        Step("known law", jobs.tell, jobs.known_laws),
    ),
    tables=tables.all_tables,
    figures=figures.all_figures,
    headlines=("degradation-claims",),
)
