"""Study of closing the gap for transfer, and its tables: by data set, split and twin, over seeds and by seed."""

import numpy as np
import pandas as pd

from papers.extra.transfer_gap import jobs
from papers.framework import Rows, Step, Study, Work, as_table
from papers.paper2_digital_twin.availability.jobs import load_sets, network, read_options
from papers.paper2_digital_twin.availability.records import SPLITS, TITLES, measure
from papers.paper3_zoa_dann.significance import sign_flip


@as_table
def seeds(work: Work) -> Rows:
    """Recordings called right without a label, folds together: by data set, split, kind and seed."""
    trained, data = work["networks"], work["data"]
    keys = list(dict.fromkeys((r.job.data, split, r.job.kind, r.job.seed) for r in trained for split in SPLITS))
    for name, split, kind, seed in keys:
        own, here = data[name], [r.value for r in trained if (r.job.data, r.job.kind, r.job.seed) == (name, kind, seed)]
        called = {recording: c for v in here for recording, c in v[split]["rows"]["0"]["calls"].items()}
        right = {recording: own.labels[recording] == c for recording, c in called.items()}
        faults = [np.mean([right[r] for r in right if own.labels[r] == k]) for k in {own.labels[r] for r in right}]
        score = [max(v[split]["scores"]["source_accuracy"]) for v in here]
        yield {
            "data": TITLES[name], "split by": split, "twin": kind, "seed": seed, "recordings": len(right),
            "accuracy": np.mean(list(right.values())), "balanced accuracy": np.mean(faults),
            "on its own machines held out": np.mean(score),
        }  # fmt: skip


@as_table
def means(rows: pd.DataFrame) -> Rows:
    """Mean and deviation over seeds; what closing adds, and exact p of sign flips of the pairs."""
    for (data, split), part in rows.groupby(["data", "split by"], sort=False):
        wide = part.pivot(index="seed", columns="twin", values="accuracy")
        gain = (wide["gap closed"] - wide["as printed"]).to_numpy(float)
        for kind in jobs.KINDS:
            own = part[part["twin"] == kind]
            yield {
                "data": data, "split by": split, "twin": kind, "seeds": len(own),
                "recordings": own["recordings"].max(), "accuracy": own["accuracy"].mean(), "std": own["accuracy"].std(),
                "balanced accuracy": own["balanced accuracy"].mean(),
                "on its own machines held out": own["on its own machines held out"].mean(),
                "gain": gain.mean() if kind == "gap closed" else np.nan,
                "p": sign_flip(gain) if kind == "gap closed" else np.nan,
            }  # fmt: skip


STUDY = Study(
    name="transfer_gap",
    title="what the paper's twin teaches, with its gap closed and without",
    options=jobs.Options,
    steps=(
        Step("records", load_sets),
        Step("data", lambda work: {n: measure(own, n, read_options().image) for n, own in work["records"].items()}),
        Step("populations", jobs.simulate, jobs.populations),
        Step("networks", network, jobs.networks, jobs.inputs),
    ),
    tables={"transfer-gap-seeds": seeds, "transfer-gap": lambda work: means(work.tables["transfer-gap-seeds"])},
    headlines=("transfer-gap",),
)
