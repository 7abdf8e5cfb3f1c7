"""Declaration of the dynamics study."""

from papers.framework import Step, Study
from papers.paper2_digital_twin.dynamics import figures, jobs, tables

STUDY = Study(
    name="dynamics",
    title="contact dynamics, simulated",
    options=jobs.Options,
    check=jobs.check,
    steps=(
        Step("healthy", jobs.settle, lambda work: jobs.cases(work, ("healthy",), work.options.settle_s)),
        Step("faulty", jobs.strike, lambda work: jobs.cases(work, work.options.faults, work.options.fault_s)),
    ),
    tables=tables.all_tables,
    figures=figures.all_figures,
    headlines=("dynamics-balance", "dynamics-faults"),
)
