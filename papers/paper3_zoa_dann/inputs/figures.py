"""Figures of the result, in colours that colour-blind readers tell apart (Okabe and Ito 2008; cividis)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure

from papers.framework import Work
from papers.paper3_zoa_dann.inputs.jobs import LABELS
from papers.paper3_zoa_dann.inputs.options import Options
from papers.paper3_zoa_dann.inputs.tables import cells
from papers.paper3_zoa_dann.source import simulate
from twingap.adapt import VIEWS, Windows, t_interval
from twingap.adapt.views import ORDERS

if TYPE_CHECKING:
    from papers.paper3_zoa_dann.inputs.jobs import TaskResult

CLASS_COLOURS: Final = ("#009E73", "#0072B2", "#D55E00", "#CC79A7", "#E69F00")
LINES: Final = {"inner": "BPFI", "outer": "BPFO", "ball": "2 BSF"}
"""Name of the line that a fault shows in an envelope spectrum."""
METHOD_COLOURS: Final = {"source_only": "#56B4E9", "dann": "#D55E00"}
METHOD_MARKERS: Final = {"source_only": "o", "dann": "s"}
WORDS: Final = {
    "waveform": "waveform",
    "spectrum": "spectrum",
    "envelope_spectrum": "envelope\nspectrum",
    "whitened_envelope_spectrum": "whitened\nenvelope",
}


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    """Every figure with its name."""
    results, options, data = work["results"], work.options, work.title
    yield "accuracy", accuracy(results, data)
    for result in results:
        yield f"confusion-{result.task.name}", confusion(result, options, data)
        yield f"tsne-{result.task.name}", embedding(result, options, data)
    yield "spectra", spectra(results[0], options, data)


def accuracy(results: Sequence[TaskResult], data: str) -> Figure:
    """Accuracy on the target by input and method, with 95 % intervals over seeds, and the yardsticks."""
    columns = min(3, len(results))
    rows = -(-len(results) // columns)
    figure = Figure(figsize=(max(7.0, 4.9 * columns), 4.4 * rows + 1.4), layout="constrained")
    panels = np.array(figure.subplots(rows, columns, sharey=True, squeeze=False))
    for empty in panels.flat[len(results) :]:
        empty.set_axis_off()
    for panel, result in zip(panels.flat, results, strict=False):
        found = cells(result)
        views = list(dict.fromkeys(view for view, _ in found))
        for (view, method), trainings in found.items():
            values = 100 * np.array([t.value["accuracy"][t.value["place"]] for t in trainings])
            at = views.index(view) + (-0.15 if method == "source_only" else 0.15)
            low, high = t_interval(list(values), 0.95)
            colour = METHOD_COLOURS[method]
            if np.isfinite(low):
                panel.plot([at, at], [max(low, 0), min(high, 100)], color=colour, lw=3, alpha=0.6, zorder=2)
            panel.plot(np.full(values.size, at), values, ".", color="0.35", ms=5, zorder=3)
            label = LABELS[method] if view == views[0] else None
            panel.plot(at, values.mean(), METHOD_MARKERS[method], color=colour, ms=11, label=label, zorder=4)
        panel.axhline(100 * result.majority, color="0.4", ls=":", lw=1.8, label="majority class")
        panel.axhline(100 * result.analyst.accuracy, color="k", ls="--", lw=1.8, label="analyst's rule")
        panel.set_xticks(range(len(views)), [WORDS.get(v, v) for v in views], fontsize=11)
        panel.set_xlim(-0.5, len(views) - 0.5)
        panel.set_ylim(0, 100)
        panel.set_title(result.task.title.replace(", ", ",\n"))
        panel.grid(axis="y", color="0.9")
    for panel in panels[:, 0]:
        panel.set_ylabel("target windows right (%)")
    figure.legend(
        *panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4 if len(results) > 1 else 2
    )
    figure.suptitle(
        f"Trained on the contact twin, judged on {data}\nmean, seeds (dots), 95 % interval over seeds (bars)"
    )
    return figure


def confusion(result: TaskResult, options: Options, data: str) -> Figure:
    """Confusion matrices, summed over seeds: rows true, columns called, per cent of the row."""
    classes = options.target.classes
    found = cells(result)
    views = list(dict.fromkeys(view for view, _ in found))
    methods = list(dict.fromkeys(method for _, method in found))
    figure = Figure(figsize=(3.6 * len(views) + 1.4, 3.7 * len(methods) + 0.6), layout="constrained")
    panels = np.array(figure.subplots(len(methods), len(views), squeeze=False, sharex=True, sharey=True))
    for (view, method), trainings in found.items():
        panel = panels[methods.index(method), views.index(view)]
        counts = np.sum([t.value["confusion"] for t in trainings], axis=0)
        shares = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        image = panel.imshow(shares, cmap="cividis", vmin=0, vmax=100)
        for i, j in np.ndindex(shares.shape):
            panel.text(j, i, f"{shares[i, j]:.0f}", ha="center", va="center", color="w" if shares[i, j] < 55 else "k")
        panel.set_xticks(range(len(classes)), classes, rotation=40, ha="right")
        panel.set_yticks(range(len(classes)), classes)
        panel.set_title(f"{WORDS.get(view, view).replace(chr(10), ' ')}\n{LABELS[method]}")
    for panel in panels[:, 0]:
        panel.set_ylabel("true")
    for panel in panels[-1]:
        panel.set_xlabel("called")
    figure.colorbar(image, ax=panels, label="windows of the true class (%)", shrink=0.7)
    figure.suptitle(f"{result.task.title} ({data})")
    return figure


def embedding(result: TaskResult, options: Options, data: str) -> Figure:
    """t-SNE of the 100 features of simulated and measured windows, first seed: colour is class, shape is domain."""
    found = {key: trainings[0] for key, trainings in cells(result).items() if "embedding" in trainings[0].value}
    views = list(dict.fromkeys(view for view, _ in found))
    methods = list(dict.fromkeys(method for _, method in found))
    figure = Figure(figsize=(3.9 * len(views) + 0.4, 3.9 * len(methods) + 1.5), layout="constrained")
    panels = np.array(figure.subplots(len(methods), len(views), squeeze=False))
    for (view, method), training in found.items():
        panel, value = panels[methods.index(method), views.index(view)], training.value
        labels, is_target, points = value["embedding_labels"], value["embedding_is_target"], value["embedding"]
        for place in range(len(options.target.classes)):
            simulated = points[(labels == place) & ~is_target]
            measured = points[(labels == place) & is_target]
            colour = CLASS_COLOURS[place]
            panel.scatter(*simulated.T, s=26, marker="o", facecolors="none", edgecolors=colour, linewidths=1.0)
            panel.scatter(*measured.T, s=30, marker="x", color=colour, linewidths=1.4)
        panel.set_xticks([])
        panel.set_yticks([])
        panel.set_title(f"{WORDS.get(view, view).replace(chr(10), ' ')}\n{LABELS[method]}")
    handles: list[Any] = []
    from matplotlib.lines import Line2D

    for colour, name in zip(CLASS_COLOURS, options.target.classes, strict=False):
        handles.append(Line2D([], [], color=colour, marker="s", ls="", ms=9, label=name))
    handles.append(Line2D([], [], color="0.2", marker="o", mfc="none", ls="", ms=8, label="simulated"))
    handles.append(Line2D([], [], color="0.2", marker="x", ls="", ms=8, label=f"measured ({data})"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    figure.suptitle(f"t-SNE of features, {result.task.title}")
    return figure


def spectra(result: TaskResult, options: Options, data: str) -> Figure:
    """Why classes confuse: mean spectra and envelope spectra of simulated and measured windows, class by class."""
    classes = options.target.classes
    source, target = simulate(result.recipe), result.measured.evaluate
    figure = Figure(figsize=(13.5, 3.0 * len(classes) + 1.2), layout="constrained")
    panels = np.array(figure.subplots(len(classes), 2, sharex="col", squeeze=False))
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
            panels[place, 1].set_title(f"dotted: {LINES[name]} = {order:.2f} orders, and harmonics")
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
