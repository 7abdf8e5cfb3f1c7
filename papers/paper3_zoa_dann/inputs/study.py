"""Study of inputs, its tables, and a figure of the spectra that classes confuse."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from papers.figures import LINE_NAMES, subplots
from papers.framework import Rows, Step, Study, Work, as_table
from papers.intervals import intervals, std
from papers.paper3_zoa_dann.inputs import jobs
from papers.paper3_zoa_dann.inputs.jobs import LABELS, TaskResult
from papers.paper3_zoa_dann.inputs.options import Options
from papers.paper3_zoa_dann.job import Job
from papers.paper3_zoa_dann.source import simulate
from twingap.adapt import VIEWS, Scores, Windows
from twingap.adapt.views import ORDERS
from twingap.sweep import Result


@as_table
def accuracy(work: Work) -> Rows:
    """A row per task, input and method, then the yardsticks. ``oracle`` is of the checkpoint that target labels would
    have chosen; "chosen by ..." takes, for each seed, the input and method with the highest label-free score."""
    for result in work["results"]:
        for (view, method), trainings in result.cells.items():
            yield _row(result, work.title, view, LABELS[method], trainings, work.options)
        chosen = f"chosen by {work.options.judging.criterion}"
        yield _row(result, work.title, "any", chosen, _chosen(result, work.options), work.options)
        yield _yardstick(result, work.title, "-", "majority class", result.majority)
        yield _yardstick(result, work.title, "envelope", "analyst's rule", result.analyst)
        yield _yardstick(result, work.title, "envelope", "analyst's rule, whole recordings", result.analyst_whole)


def _chosen(result: TaskResult, options: Options) -> list[Result[Job]]:
    """For each seed the training that the label-free criterion prefers over inputs and methods."""
    criterion = options.judging.criterion
    by_seed: dict[int, list[Result[Job]]] = {}
    for training in result.trainings:
        by_seed.setdefault(training.job.seed, []).append(training)
    return [max(ts, key=lambda t: t.value["criteria"][criterion][t.value["place"]]) for ts in by_seed.values()]


def _row(
    result: TaskResult, data: str, view: str, method: str, trainings: list[Result[Job]], options: Options
) -> dict[str, Any]:
    values = [t.value["accuracy"][t.value["place"]] for t in trainings]
    return {
        "data": data, "task": result.task.title, "input": view, "method": method, "seeds": len(values),
        "accuracy": float(np.mean(values)), "std": std(values), **intervals(values, options.judging.levels, 0.0, 1.0),
        "balanced": float(np.mean([t.value["balanced_accuracy"][t.value["place"]] for t in trainings])),
        "recordings_right": float(np.mean([t.value["recordings_right"] for t in trainings])),
        "recordings": trainings[0].value["recordings"],
        "oracle": float(np.mean([max(t.value["accuracy"]) for t in trainings])),
        "source_accuracy": float(np.mean([t.value["source_accuracy"] for t in trainings])),
    }  # fmt: skip


def _yardstick(result: TaskResult, data: str, view: str, method: str, found: Scores | float) -> dict[str, Any]:
    row = {"data": data, "task": result.task.title, "input": view, "method": method, "seeds": 0}
    if isinstance(found, float):
        return row | {"accuracy": found}
    return row | {
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


@as_table
def selection(work: Work) -> Rows:
    """Accuracy by the criterion that chose the checkpoint, mean over seeds; the last and the oracle beside them."""
    for result in work["results"]:
        for (view, method), trainings in result.cells.items():
            values = [t.value for t in trainings]
            yield {
                "data": work.title, "task": result.task.title, "input": view, "method": LABELS[method],
                **{name: np.mean([v["accuracy"][v["chosen"][name]] for v in values]) for name in values[0]["chosen"]},
                "last checkpoint": np.mean([v["accuracy"][-1] for v in values]),
                "oracle (target labels)": np.mean([max(v["accuracy"]) for v in values]),
            }  # fmt: skip


@as_table
def adaptation(work: Work) -> Rows:
    """What adaptation adds: accuracy of DANN minus that without, paired by seed, mean over tasks, by input;
    ``domain_accuracy`` is the discriminator's in the end (0.5: it can no longer tell)."""
    for view in dict.fromkeys(view for result in work["results"] for view, _ in result.cells):
        gains, told = [], []
        for result in work["results"]:
            by_method = {method: trainings for (v, method), trainings in result.cells.items() if v == view}
            plain, adapted = ([t.value["accuracy"][t.value["place"]] for t in by_method[m]] for m in LABELS)
            gains.append(np.subtract(adapted, plain))
            told += [t.value["domain_accuracy"][-1] for t in by_method["dann"]]
        of_seeds = np.mean(gains, axis=0)
        row = {"data": work.title, "input": view, "tasks": len(work["results"]), "gain": float(of_seeds.mean())}
        row |= intervals(of_seeds, work.options.judging.levels)
        yield row | {"domain_accuracy": float(np.mean(told))}


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
