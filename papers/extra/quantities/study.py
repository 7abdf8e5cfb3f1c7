"""Declaration of the study of quantities; its configuration is the comparison's."""

from papers.extra.quantities import jobs, tables
from papers.framework import Step, Study
from papers.paper3_zoa_dann.comparison.jobs import Options, check, load_tasks

STUDY = Study(
    name="quantities",
    title="the network on waveforms and on envelope spectra",
    options=Options,
    check=check,
    steps=(Step("tasks", load_tasks), Step("networks", jobs.networks)),
    tables=tables.all_tables,
    headlines=("quantities-mean",),
)
