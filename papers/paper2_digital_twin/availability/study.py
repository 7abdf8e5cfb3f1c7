"""Declaration of the availability study."""

from papers.framework import Step, Study
from papers.paper2_digital_twin.availability import figures, jobs, tables
from papers.paper2_digital_twin.availability.records import measure

STUDY = Study(
    name="availability",
    title="diagnosis by how much labelled data there is",
    options=jobs.Options,
    steps=(
        Step("records", jobs.load_sets),
        Step("data", lambda work: {n: measure(own, n, work.options.image) for n, own in work["records"].items()}),
        Step("healthy", jobs.healthy),
        Step("shallows", jobs.shallow, jobs.shallows, jobs.of_data),
        Step("alarms", jobs.alarm, jobs.alarms, jobs.of_data),
        Step("checks", jobs.false_alarms, jobs.checks),
        Step("plants", jobs.plants),
        Step("source", jobs.simulated),
        Step("networks", jobs.network, jobs.networks, jobs.of_both),
        Step("calls", tables.calls),
    ),
    tables={
        "availability-accuracy": tables.accuracy,
        "availability-crossings": tables.crossings,
        "availability-choice": tables.choices,
        "availability-selection": tables.selection,
        "availability-head": tables.head,
        "availability-sources": tables.sources,
        "availability-recordings": tables.recordings,
        "availability-alarms": tables.alarms,
        "availability-severity": tables.severity,
        "availability-size": tables.size,
        "availability-check": tables.checks,
    },
    figures={
        "availability-crossings": lambda work: figures.crossings(
            work.tables["availability-accuracy"], work.tables["availability-crossings"]
        ),
        "availability-severity": figures.severity,
    },
    letters=(14, 13),
    headlines=("availability-accuracy", "availability-crossings", "availability-choice"),
)
