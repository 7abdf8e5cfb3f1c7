"""Declaration of the study of layers, and its tables: probes by layer, and checkpoints."""

from typing import Any

import numpy as np
import pandas as pd

from papers.extra.layers import jobs
from papers.framework import Step, Study, Work
from papers.paper3_zoa_dann.comparison.jobs import load_tasks


def tables(work: Work) -> dict[str, pd.DataFrame]:
    """Shares of judged windows called right, healthy ones and faulty ones apart."""
    layers, checkpoints = [], []
    for data, found in work["results"]:
        job, value = found.job, found.value
        about = {"data": data, "task": job.task, "method": job.method, "seed": job.seed}
        for layer, by in value["layers"].items():
            for taught, right in by.items():
                layers.append(about | {"layer": layer, "probe taught by": taught} | _shares(right))
        for place, right in enumerate(value["checkpoints"]):
            checkpoints.append(about | {"checkpoint": place + 1, "chosen": place == value["chosen"]} | _shares(right))
    return {"layers": pd.DataFrame(layers), "layers-checkpoints": pd.DataFrame(checkpoints)}


def _shares(right: list[float]) -> dict[str, Any]:
    """Healthy is the first class of every task; judged windows are as many of each class."""
    return {"all": np.mean(right), "healthy": right[0], "faults": np.mean(right[1:])}


STUDY = Study(
    name="layers",
    title="what the layers keep of the classes",
    options=jobs.Options,
    steps=(Step("tasks", load_tasks), Step("results", jobs.results)),
    tables=tables,
    headlines=("layers", "layers-checkpoints"),
)
