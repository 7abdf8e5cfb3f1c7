"""Study of quantities, whose configuration is the comparison's: trials; means by data set, method and quantity."""

import pandas as pd

from papers.extra.quantities import jobs
from papers.framework import Rows, Step, Study, Work, as_table
from papers.paper3_zoa_dann.comparison.jobs import Options, load_tasks
from papers.paper3_zoa_dann.significance import paired


def table(work: Work) -> pd.DataFrame:
    """A row per trial, with the data set's title."""
    return pd.DataFrame(
        {
            "data": data, "task": own.job.task, "method": own.job.method,
            "quantity": own.job.inputs.quantity, "seed": own.job.seed, "accuracy": own.value["accuracy"],
            "oracle": own.value["oracle_accuracy"], "source_accuracy": own.value["source_accuracy"],
            "seconds": own.seconds,
        }
        for data, own in work["networks"]
    )  # fmt: skip


@as_table
def means(rows: pd.DataFrame) -> Rows:
    """Mean over tasks and seeds; gain over the paper's quantity by pairs of task and seed, with sign-flip p."""
    pair, plain = ["task", "seed"], jobs.QUANTITIES[0]
    for (data, method), own in rows.groupby(["data", "method"], sort=False):
        first = own[own["quantity"] == plain].set_index(pair)["accuracy"]
        for quantity, of in own.groupby("quantity", sort=False):
            gain, found = paired(of.set_index(pair)["accuracy"], first)
            over = {"gain": gain.mean(), "pairs_won": found["won"], "pairs": len(gain), "p": found["p"]}
            yield {
                "data": data, "method": method, "quantity": quantity, "accuracy": of["accuracy"].mean(),
                "std": of["accuracy"].std(), "oracle": of["oracle"].mean(),
                "source_accuracy": of["source_accuracy"].mean(),
                **(dict.fromkeys(over, float("nan")) | {"pairs": len(gain)} if quantity == plain else over),
            }  # fmt: skip


STUDY = Study(
    name="quantities",
    title="the network on waveforms and on envelope spectra",
    options=Options,
    steps=(Step("tasks", load_tasks), Step("networks", jobs.networks)),
    tables={"quantities": table, "quantities-mean": lambda work: means(work.tables["quantities"])},
    headlines=("quantities-mean",),
)
