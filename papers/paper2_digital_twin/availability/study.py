"""Declaration of the availability study."""

from papers.framework import Step, Study
from papers.paper2_digital_twin.availability import figures, jobs, tables

STUDY = Study(
    name="availability",
    title="diagnosis by how much labelled data there is",
    options=jobs.Options,
    steps=(
        Step("records", jobs.load_sets),
        Step("data", jobs.measured),
        Step("healthy", jobs.healthy),
        Step("shallows", jobs.shallow, jobs.shallows, jobs.of_data),
        Step("alarms", jobs.alarm, jobs.alarms, jobs.of_data),
        Step("checks", jobs.false_alarms, jobs.checks),
        Step("plants", jobs.plants),
        Step("source", jobs.simulated),
        Step("networks", jobs.network, jobs.networks, jobs.of_both),
    ),
    tables=tables.all_tables,
    figures=figures.all_figures,
    letters=(14, 13),
    headlines=("availability-accuracy", "availability-crossings", "availability-choice"),
)
