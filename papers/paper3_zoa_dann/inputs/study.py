"""Declaration of the study of inputs."""

from papers.framework import Step, Study
from papers.paper3_zoa_dann.inputs import figures, jobs, options, tables

STUDY = Study(
    name="inputs",
    title="a plain network, with and without adaptation, trained on the contact twin",
    options=options.Options,
    steps=(Step("target", jobs.load), Step("results", jobs.results)),
    tables=tables.all_tables,
    figures=figures.all_figures,
    headlines=("accuracy", "adaptation"),
    columns={"accuracy": ("task", "input", "method", "accuracy", "std", "low_95", "high_95", "oracle")},
)
