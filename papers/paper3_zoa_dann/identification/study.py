"""Identification study, and its tables."""

from typing import Any

import numpy as np

from papers.framework import Rows, Step, Study, Work, as_input, as_table
from papers.paper3_zoa_dann.identification import figures, jobs
from papers.paper3_zoa_dann.identification.agreement import METRICS

READINGS = ("contact alone", "with noises")
KINDS = ("waveform", "spectrum")


@as_table
def convergence(work: Work) -> Rows:
    """Cost that each optimiser has reached in the end, over seeds; ``near`` is the median number of evaluations after
    which a run is within 1 % of the least cost of all, empty when half of the runs never are."""
    searches = work["searches"]
    for fault, setting in dict.fromkeys((r.job.fault, r.job.setting) for r in searches):
        here = [r for r in searches if (r.job.fault, r.job.setting) == (fault, setting)]
        least = min(float(r.value["best"][-1]) for r in here)
        for optimiser in dict.fromkeys(r.job.optimiser for r in here):
            runs = [r.value for r in here if r.job.optimiser == optimiser]
            cost = np.array([float(v["best"][-1]) for v in runs])
            # Evaluations until a run is near the least for the first time; infinity when it never is.
            near = [next((n for n, c in enumerate(v["best"], 1) if c <= 1.01 * least), np.inf) for v in runs]
            k, c = (np.array([v[name] for v in runs]) for name in ("stiffness", "damping"))
            half = float(np.median(near))
            yield {
                "fault": fault, "setting": setting, "optimiser": optimiser, "runs": len(runs),
                "evaluations": len(runs[0]["best"]), "cost median": np.median(cost), "cost least": cost.min(),
                "cost most": cost.max(), "near": half if np.isfinite(half) else None,
                "stiffness median": np.median(k), "stiffness least": k.min(), "stiffness most": k.max(),
                "damping median": np.median(c), "damping least": c.min(), "damping most": c.max(),
            }  # fmt: skip


@as_table
def agreement(work: Work) -> Rows:
    """Metrics of each twin on the half of the recording that it was not fitted to."""
    for r in work["comparisons"]:
        for reading in READINGS:
            metrics = {f"{kind} {m}": r.value[f"{reading}: {kind} {m}"] for kind in KINDS for m in METRICS}
            yield {
                "fault": r.job.fault, "setting": r.job.setting, "twin": r.job.twin, "reading": reading,
                "stiffness": r.job.stiffness, "damping": r.job.damping, "cost": r.value["cost"],
                "contact share": r.value["contact share"], **metrics,
            }  # fmt: skip


@as_table
def drops(work: Work) -> Rows:
    """By how many percent each metric falls from the setting's first twin to the others, mean and range over faults."""
    found = work.tables["identification-agreement"]
    for (setting, reading), here in found.groupby(["setting", "reading"], sort=False):
        first = here["twin"].iloc[0]
        before = here[here["twin"] == first].set_index("fault")
        for twin in list(dict.fromkeys(here["twin"]))[1:]:
            after = here[here["twin"] == twin].set_index("fault")
            for kind in KINDS:
                row: dict[str, Any] = {"setting": setting, "reading": reading, "from": first, "to": twin, "of": kind}
                for metric, published in zip(METRICS, work.options.published_drops, strict=True):
                    name = f"{kind} {metric}"
                    change = 100 * (1 - after[name] / before[name])
                    row |= {
                        f"{metric} %": change.mean(), f"{metric} least": change.min(), f"{metric} most": change.max(),
                        f"{metric} published": published if setting == "paper" else None,
                    }  # fmt: skip
                yield row


@as_table
def recovery(work: Work) -> Rows:
    """How far identified parameters of simulated machines are off, and how often 90 % intervals hold them."""
    for fault in dict.fromkeys(r.job.fault for r in work["recoveries"]):
        here = [r.value for r in work["recoveries"] if r.job.fault == fault]
        for name in ("stiffness", "damping"):
            off = np.abs([v[name] for v in here])
            inside = [v[f"{name} inside"] for v in here if v[f"{name} inside"] is not None]
            yield {
                "fault": fault, "parameter": name, "snr_db": work.options.snr_db, "machines": len(here),
                "median off %": 100 * np.median(off), "most off %": 100 * off.max(),
                "within 5 %": f"{(off <= 0.05).sum()} of {off.size}",
                "in 90 % interval": f"{sum(inside)} of {len(inside)}", "without interval": len(here) - len(inside),
                "data": "simulated machines",
            }  # fmt: skip


STUDY = Study(
    name="identification",
    title="identification of the twin",
    options=jobs.Options,
    steps=(
        Step("halves", jobs.halves),
        Step("searches", jobs.search, jobs.searches, lambda work: {"fit": jobs.both(work)["fit"]}),
        Step("comparisons", jobs.compare, jobs.comparisons, jobs.both),
        Step("recoveries", jobs.recover, jobs.machines, as_input),
    ),
    named=True,
    tables={
        "identification-convergence": convergence,
        "identification-agreement": agreement,
        "identification-drops": drops,
        "identification-recovery": recovery,
    },
    figures=figures.all_figures,
    letters=(14, 13),
    headlines=("identification-drops", "identification-recovery"),
)
