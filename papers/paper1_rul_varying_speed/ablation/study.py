"""Declaration of the ablation."""

from papers.framework import Step, Study
from papers.paper1_rul_varying_speed.ablation import jobs, tables

STUDY = Study(
    name="ablation",
    title="adversarial models, an encoding at a time",
    options=jobs.Options,
    steps=(Step("options", jobs.lives), Step("target", jobs.target), Step("rows", jobs.rows)),
    tables=tables.all_tables,
    headlines=("ablation", "ablation_summary"),
)
