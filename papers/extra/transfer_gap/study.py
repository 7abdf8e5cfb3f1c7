"""Declaration of the study of closing the gap for transfer."""

from papers.extra.transfer_gap import jobs, tables
from papers.framework import Step, Study
from papers.paper2_digital_twin.availability.jobs import network

STUDY = Study(
    name="transfer_gap",
    title="what the paper's twin teaches, with its gap closed and without",
    options=jobs.Options,
    steps=(
        Step("records", jobs.load_sets),
        Step("data", jobs.measured),
        Step("populations", jobs.simulate, jobs.populations),
        Step("networks", network, jobs.networks, jobs.inputs),
    ),
    tables=tables.all_tables,
    headlines=("transfer-gap",),
)
