"""Declaration of the study of shallow baselines; its configuration is the comparison's."""

from importlib.util import find_spec

from papers.extra.baselines import jobs, tables
from papers.framework import Step, Study
from papers.paper3_zoa_dann.comparison.jobs import Options, check, load_tasks

STUDY = Study(
    name="baselines",
    title="shallow domain adaptation by skada",
    options=Options,
    check=check,
    steps=(Step("tasks", load_tasks), Step("results", jobs.results)),
    tables=tables.all_tables,
    headlines=("baselines-mean",),
    at_hand=lambda root: find_spec("skada") is not None,
)
