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
    named=True,
    tables={
        "degradation-runs": tables.runs,
        "degradation-fusion9": tables.fusion9,
        "degradation-choice": tables.choice,
        "degradation-fits": tables.fits,
        "degradation-errors": tables.error_rows,
        "degradation-errors-summary": tables.error_summary,
        "degradation-pairs": tables.pairs,
        "degradation-out-of-sample": tables.out_of_sample,
        "degradation-criteria": tables.criteria_summary,
        "degradation-lives": tables.life_rows,
        "degradation-lives-summary": tables.life_summary,
        "degradation-coverage": tables.coverage,
        "degradation-known-law": tables.known_law,
        "degradation-claims": tables.claims,
    },
    figures=figures.all_figures,
    headlines=("degradation-claims",),
)
