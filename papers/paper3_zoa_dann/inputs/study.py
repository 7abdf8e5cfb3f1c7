"""Study of inputs, its tables, and a figure of the spectra that classes confuse."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.figures import LINE_NAMES, subplots
from papers.framework import Rows, Step, Study, Work, as_table
from papers.intervals import intervals
from papers.paper3_zoa_dann.inputs import jobs
from papers.paper3_zoa_dann.inputs.jobs import LABELS, TaskResult
from papers.paper3_zoa_dann.inputs.options import Options
from papers.paper3_zoa_dann.source import simulate
from twingap.adapt import CRITERIA, VIEWS, Windows
from twingap.adapt.views import ORDERS


def trainings(work: Work) -> pd.DataFrame:
    """A row per training; ``score`` is the label-free one of its checkpoint."""
    criterion = work.options.judging.criterion
    return pd.DataFrame(
        {
            "data": work.title, "task": result.task.title, "input": t.job.view, "method": LABELS[t.job.method],
            "seed": t.job.seed, "accuracy": v["accuracy"][v["place"]], "balanced": v["balanced_accuracy"][v["place"]],
            "recordings_right": v["recordings_right"], "recordings": v["recordings"], "oracle": max(v["accuracy"]),
            "source_accuracy": v["source_accuracy"], "domain_accuracy": v["domain_accuracy"][-1],
            "last checkpoint": v["accuracy"][-1], "score": v["criteria"][criterion][v["place"]],
            **{f"by {name}": v["accuracy"][place] for name, place in v["chosen"].items()},
        }
        for result in work["results"]
        for t, v in ((t, t.value) for t in result.trainings)
    )  # fmt: skip


@as_table
def accuracy(work: Work) -> Rows:
    """A row per task, input and method, then the yardsticks. ``oracle`` is of the checkpoint that target labels would
    have chosen; "chosen by ..." takes, for each seed, the input and method with the highest label-free score."""
    judging, every = work.options.judging, trainings(work)
    for result in work["results"]:
        task = {"data": work.title, "task": result.task.title}
        own = every[every["task"] == result.task.title]
        chosen = own.loc[own.groupby("seed", sort=False)["score"].idxmax()]
        cells = list(own.groupby(["input", "method"], sort=False))
        for (view, method), part in [*cells, (("any", f"chosen by {judging.criterion}"), chosen)]:
            yield {
                **task, "input": view, "method": method, "seeds": len(part), "accuracy": part["accuracy"].mean(),
                "std": part["accuracy"].std(), **intervals(part["accuracy"], judging.levels, 0.0, 1.0),
                "balanced": part["balanced"].mean(), "recordings_right": part["recordings_right"].mean(),
                "recordings": part["recordings"].iloc[0], "oracle": part["oracle"].mean(),
                "source_accuracy": part["source_accuracy"].mean(),
            }  # fmt: skip
        yield {**task, "input": "-", "method": "majority class", "seeds": 0, "accuracy": result.majority}
        for where, found in (("", result.analyst), (", whole recordings", result.analyst_whole)):
            yield {
                **task, "input": "envelope", "method": f"analyst's rule{where}", "seeds": 0,
                "accuracy": found.accuracy, "balanced": found.balanced_accuracy,
                "recordings_right": float(found.recordings_right), "recordings": found.recordings,
            }  # fmt: skip


@as_table
def confusion(work: Work) -> Rows:
    """Windows by true and predicted class, summed over seeds, and those of the analyst's rule."""
    classes = work.options.target.classes
    for result in work["results"]:
        counts = {
            (view, LABELS[method]): np.sum([t.value["confusion"] for t in trainings], axis=0)
            for (view, method), trainings in result.cells.items()
        }
        counts["envelope", "analyst's rule"] = result.analyst.confusion
        for (view, method), table in counts.items():
            for true, line in zip(classes, table, strict=True):
                about = {"data": work.title, "task": result.task.title, "input": view, "method": method, "true": true}
                yield about | {f"called {name}": int(n) for name, n in zip(classes, line, strict=True)}


@as_table
def recordings(work: Work) -> Rows:
    """What each recording's windows are called, as shares over windows and seeds; by the analyst's rule as well."""
    classes = work.options.target.classes
    for result in work["results"]:
        groups, conditions = result.measured.evaluate.group, result.task.evaluate.conditions
        called = {
            (view, LABELS[method]): [np.concatenate([t.value["probabilities"][groups == c.group] for t in trainings])
                                     for c in conditions]
            for (view, method), trainings in result.cells.items()
        }  # fmt: skip
        called["envelope", "analyst's rule"] = [result.analyst_calls[groups == c.group] for c in conditions]
        called["envelope", "analyst's rule, whole recordings"] = [row[None] for row in result.analyst_whole_calls]
        for (view, method), of_each in called.items():
            for condition, probabilities in zip(conditions, of_each, strict=True):
                counts = np.bincount(probabilities.argmax(axis=1), minlength=len(classes))
                shares = zip(classes, counts / counts.sum(), strict=True)
                yield {
                    "data": work.title, "task": result.task.title, "input": view, "method": method,
                    "recording": condition.name, "bearing": condition.extra["bearing_id"], "true": condition.fault,
                    **{f"called {name}": round(float(share), 3) for name, share in shares},
                }  # fmt: skip


def selection(work: Work) -> pd.DataFrame:
    """Accuracy by the criterion that chose the checkpoint, mean over seeds; the last and the oracle beside them."""
    cells = trainings(work).groupby(["data", "task", "input", "method"], sort=False)
    chosen = {f"by {name}": name for name in CRITERIA}
    found = cells[[*chosen, "last checkpoint", "oracle"]].mean().reset_index()
    return found.rename(columns=chosen | {"oracle": "oracle (target labels)"})


@as_table
def adaptation(work: Work) -> Rows:
    """What adaptation adds: accuracy of DANN minus that without, paired by seed, mean over tasks, by input;
    ``domain_accuracy`` is the discriminator's in the end (0.5: it can no longer tell)."""
    for view, own in trainings(work).groupby("input", sort=False):
        pairs = own.pivot(index=["task", "seed"], columns="method", values="accuracy")
        of_seeds = (pairs[LABELS["dann"]] - pairs[LABELS["source_only"]]).groupby("seed").mean()
        yield {
            "data": work.title, "input": view, "tasks": len(work["results"]), "gain": of_seeds.mean(),
            **intervals(of_seeds, work.options.judging.levels),
            "domain_accuracy": own.loc[own["method"] == LABELS["dann"], "domain_accuracy"].mean(),
        }  # fmt: skip


@as_table
def identification(work: Work) -> Rows:
    yield from ({"data": work.title, "task": r.task.title, **r.identified} for r in work["results"])


def spectra(result: TaskResult, options: Options, data: str) -> Figure:
    """Why classes confuse: mean spectra and envelope spectra of simulated and measured windows, class by class."""
    classes = options.target.classes
    source, target = simulate(result.recipe), result.measured.evaluate
    figure, panels = subplots((13.5, 3.0 * len(classes) + 1.2), len(classes), 2, sharex="col", squeeze=False)
    styles = (("simulated (contact twin)", source, "#0072B2", 2.4), (f"measured ({data})", target, "#D55E00", 1.3))
    for place, name in enumerate(classes):
        for label, windows, colour, width in styles:
            assert windows.labels is not None
            own = windows.take(windows.labels == place)
            khz, level = _mean_spectrum(own)
            panels[place, 0].plot(khz, level, color=colour, lw=width, label=label)
            panels[place, 1].plot(ORDERS, VIEWS["envelope_spectrum"](own).mean(axis=0), color=colour, lw=width)
        if name != "healthy":
            order = result.recipe.bearing.fault_order(name)
            for harmonic in range(1, int(ORDERS[-1] / order) + 1):
                panels[place, 1].axvline(harmonic * order, color="0.5", ls=":", lw=1.4, zorder=0)
            panels[place, 1].set_title(f"dotted: {LINE_NAMES[name]} = {order:.2f} orders, and harmonics")
        panels[place, 0].set_ylabel(f"{name}\nPSD (dB re highest)")
        panels[place, 1].set_ylabel("ln(1 + line / median)\n(no unit)")
    panels[0, 0].set_title("mean power spectral density")
    panels[0, 1].set_title("mean envelope spectrum")
    panels[-1, 0].set_xlabel("frequency (kHz)")
    panels[-1, 1].set_xlabel("order (multiples of shaft speed)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.suptitle(f"Windows of unit variance, {result.task.title}")
    return figure


def _mean_spectrum(windows: Windows) -> tuple[Any, Any]:
    x = VIEWS["waveform"](windows)
    power = np.abs(np.fft.rfft(x * np.hanning(x.shape[1]), axis=1)) ** 2
    smooth = np.convolve(power.mean(axis=0), np.full(9, 1 / 9), mode="same")[4:-4]
    khz = np.fft.rfftfreq(x.shape[1], 1e3 / windows.fs_hz[0])[4:-4]
    return khz, 10 * np.log10(smooth / smooth.max())


STUDY = Study(
    name="inputs",
    title="a plain network, with and without adaptation, trained on the contact twin",
    options=Options,
    steps=(Step("target", jobs.load), Step("results", jobs.results)),
    tables={
        "accuracy": accuracy,
        "confusion": confusion,
        "recordings": recordings,
        "adaptation": adaptation,
        "selection": selection,
        "identification": identification,
    },
    figures={"spectra": lambda work: spectra(work["results"][0], work.options, work.title)},
    headlines=("accuracy", "adaptation"),
    columns={"accuracy": ("task", "input", "method", "accuracy", "std", "low_95", "high_95", "oracle")},
)
