"""Declaration of the study of the virtual rig's lives."""

from papers.extra.rig_lives import jobs, tables
from papers.framework import Step, Study
from twingap.rigs.smart_maintenance import TITLE

STUDY = Study(
    name="rig_lives",
    title="remaining life of the virtual rig's runs",
    data=TITLE,
    options=jobs.Options,
    steps=(Step("runs", jobs.amplitudes, jobs.jobs, words=lambda job: f"bench {job.seed}, {job.bearing}"),),
    tables=tables.all_tables,
    headlines=("rig_lives", "rig_lives_means"),
)
