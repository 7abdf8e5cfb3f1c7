"""Declaration of the study of pdm-bench's scenarios."""

from importlib.util import find_spec

from papers.extra.pdm_bench import jobs, tables
from papers.framework import Step, Study

STUDY = Study(
    name="pdm_bench",
    title="frozen scenarios of pdm-bench",
    options=jobs.Options,
    check=jobs.check,
    steps=(Step("splits", jobs.load_splits), Step("rows", jobs.read_rows), Step("results", jobs.results)),
    tables=tables.all_tables,
    headlines=("pdm_bench-scenarios", "pdm_bench-mean"),
    at_hand=lambda root: find_spec("skada") is not None,
)
