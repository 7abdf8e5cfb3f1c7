"""Figures of the comparison, in colours that colour-blind readers tell apart (Okabe and Ito 2008; cividis)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from papers.figures import grid, name_axes, rule, subplots
from papers.framework import Work
from papers.paper3_zoa_dann.comparison.jobs import TaskOutcome
from papers.paper3_zoa_dann.comparison.tables import CLEAN, confusion_counts, trials
from papers.paper3_zoa_dann.comparison.trial import ALL, ANALYST, OWN, noise_words

if TYPE_CHECKING:
    import pandas as pd


CLASS_COLOURS: Final = ("#009E73", "#0072B2", "#D55E00", "#CC79A7", "#E69F00")
GREY, BLUE, ORANGE, GREEN = "#666666", "#0072B2", "#D55E00", "#009E73"
GROUPS: Final = {
    "no adaptation": ("VMD+SVM", "Non-DA", ANALYST),
    "adaptation from the literature": ("MMD", "DANN", "DACD"),
    "parts left out of Proposed": ("Base-Attn", "Non-DN", "Base-NDN"),
    "gap closed; this project's": ("Non-DA, gap closed", "Proposed, gap closed", OWN),
}
"""Panels of the noise figure: what stands beside Proposed in each."""
PROPOSED: Final = "Proposed"
LOOKS: Final = ((GREY, "o", ":"), (BLUE, "s", "--"), (GREEN, "^", "-."))
"""Colour, marker and line of the methods of a group, in order."""
FAMILY: Final = {"A": "tasks A", "B": "tasks B"}


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    options = work.options
    outcomes = sorted(work["outcomes"], key=lambda outcome: outcome.task.name)
    runs = trials(outcomes)
    families = dict.fromkeys(outcome.task.family for outcome in outcomes)
    for available in dict.fromkeys(runs["available"]):
        yield f"comparison-accuracy-{available}", accuracy(runs, str(available))
    if runs["main"][runs["noise"] != CLEAN].any():
        yield "comparison-noise", noise(runs)
    for family in families:
        first = next(outcome for outcome in outcomes if outcome.task.family == family)
        for snr_db, word in ((None, "clean"), (options.high_noise_db, "noisy")):
            if confusion_counts(first, "Proposed", snr_db) is not None:
                yield f"comparison-confusion-{first.task.name}-{word}", confusion(first, snr_db)
            if embedded(first, snr_db):
                yield f"comparison-tsne-{first.task.name}-{word}", embedding(first, snr_db)


def accuracy(runs: pd.DataFrame, available: str) -> Figure:
    """Accuracy by task and method without added noise: the mean as a number, the seeds and their range."""
    own = runs[runs["main"] & (runs["noise"] == CLEAN) & (runs["available"] == available)]
    names = list(dict.fromkeys(own["task"]))
    methods = [method for method in ALL if (own["method"] == method).any()]
    figure, panels = grid(len(names), 4, (3.5, 0.36 * len(methods) + 1.0), (2.2, 0.8), sharey=True, sharex=True)
    for panel, name in zip(panels.flat, names, strict=False):
        here = own[own["task"] == name]
        for place, method in enumerate(methods):
            values = 100 * here.loc[here["method"] == method, "accuracy"].to_numpy()
            if not values.size:
                continue
            colour = {PROPOSED: ORANGE, OWN: BLUE}.get(method, GREY)
            panel.plot([values.min(), values.max()], [place] * 2, color=colour, lw=2, alpha=0.6)
            panel.plot(values, np.full(values.size, place), "|", color=colour, ms=9, mew=1.6)
            panel.plot(values.mean(), place, "o", color=colour, mec="k", mew=0.6, ms=8)
            panel.text(106, place, f"{values.mean():.0f}", ha="left", va="center", fontsize=11, color=colour)
        panel.set(title=f"{name}, {here['data'].iloc[0]}", ylim=(len(methods) - 0.4, -0.6), xlim=(0, 122))
        panel.set_xticks(range(0, 101, 25))
        panel.set_yticks(range(len(methods)), methods)
        rule(panel, "x")
    for panel in panels.flat[max(len(names) - 4, 0) : len(names)]:
        panel.tick_params(labelbottom=True)
        panel.set_xlabel("windows right (%)")
    seeds = own["seed"].nunique()
    figure.suptitle(
        f"{available} target data, no noise added: mean (circle, number), {seeds} seeds (ticks) and their range"
    )
    return figure


def noise(runs: pd.DataFrame) -> Figure:
    """Accuracy against the SNR of added noise, mean over tasks, balanced data, of the seeds that noise was run with:
    Proposed beside one group in each panel."""
    own = runs[runs["main"] & (runs["available"] == "balanced")]
    families = list(dict.fromkeys(own["family"]))
    figure, panels = subplots(
        (16.0, 4.1 * len(families) + 0.8), len(families), len(GROUPS), sharex="row", sharey=True, squeeze=False
    )
    for line, family in zip(panels, families, strict=True):
        here = own[own["family"] == family]
        here = here[here["seed"].isin(set(here.loc[here["noise"] != CLEAN, "seed"]))]
        levels = sorted(set(here["snr_db"]) - {np.inf})
        for panel, (title, group) in zip(line, GROUPS.items(), strict=True):
            looks = dict(zip(group, LOOKS, strict=True)) | {PROPOSED: (ORANGE, "*", "-")}
            for method, (colour, marker, style) in looks.items():
                table = here[here["method"] == method].pivot_table(index="snr_db", columns="task", values="accuracy")
                if table.empty:
                    continue
                values = 100 * table.dropna().mean(axis=1)
                # Without added noise: one step to the right of the quietest level.
                at = [len(levels) if np.isinf(level) else levels.index(level) for level in values.index]
                size, width = (13, 3) if method == PROPOSED else (8, 2)
                panel.plot(
                    at, values, style, marker=marker, color=colour, mec="k", mew=0.5, ms=size, lw=width, zorder=width,
                    label=method, clip_on=False,
                )  # fmt: skip
            panel.set_xticks(range(len(levels) + 1), [*(f"{level:g}" for level in levels), "none"])
            panel.set(title=f"{FAMILY[family]}, {', '.join(dict.fromkeys(here['data']))}\n{title}", ylim=(0, 100))
            panel.grid(color="0.9")
    name_axes(panels, "SNR of added noise (dB)", "windows right (%)")
    for panel in panels[-1]:
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return figure


def confusion(outcome: TaskOutcome, snr_db: float | None) -> Figure:
    """Confusion matrices of every method, summed over seeds: rows true, columns called, per cent of the row."""
    classes = outcome.task.classes
    figure, panels = grid(len(ALL), 5, (3.4, 4.1), (0.0, 0.0), sharex=True, sharey=True)
    image = None
    for panel, method in zip(panels.flat, ALL, strict=False):
        counts = confusion_counts(outcome, method, snr_db)
        if counts is None:
            panel.set_axis_off()
            continue
        shares = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        image = panel.imshow(shares, cmap="cividis", vmin=0, vmax=100)
        for i, j in np.ndindex(shares.shape):
            panel.text(j, i, f"{shares[i, j]:.0f}", ha="center", va="center", color="w" if shares[i, j] < 55 else "k")
        panel.set_xticks(range(len(classes)), classes, rotation=40, ha="right")
        panel.set_yticks(range(len(classes)), classes)
        panel.set_title(method)
    name_axes(panels, "called", "true")
    if image is not None:
        figure.colorbar(image, ax=panels, label="windows of the true class (%)", shrink=0.7)
    figure.suptitle(f"{outcome.task.name}, {outcome.data}, balanced target data, {noise_words(snr_db)}")
    return figure


def embedded(outcome: TaskOutcome, snr_db: float | None) -> dict[str, Any]:
    """Values of the trials whose features were embedded, by method, in the order of `ALL`."""
    found = {t.job.method: t.value for t in outcome.trials if "embedding" in t.value and t.job.snr_db == snr_db}
    return {method: found[method] for method in ALL if method in found}


def embedding(outcome: TaskOutcome, snr_db: float | None) -> Figure:
    """t-SNE of the 100 features of simulated and measured windows, first seed: colour is class, shape is domain."""
    found = embedded(outcome, snr_db)
    figure, panels = grid(len(found), 4, (4.0, 4.7), (0.0, 0.0))
    for panel, (method, value) in zip(panels.flat, found.items(), strict=False):
        labels, is_target, points = value["embedding_labels"], value["embedding_is_target"], value["embedding"]
        for place in range(len(outcome.task.classes)):
            colour = CLASS_COLOURS[place]
            simulated, measured = (points[(labels == place) & (is_target == side)] for side in (False, True))
            panel.scatter(*simulated.T, s=26, marker="o", facecolors="none", edgecolors=colour, linewidths=1.0)
            panel.scatter(*measured.T, s=30, marker="x", color=colour, linewidths=1.4)
        panel.set(xticks=[], yticks=[], title=method)
    handles = [
        Line2D([], [], color=colour, marker="s", ls="", ms=9, label=name)
        for colour, name in zip(CLASS_COLOURS, outcome.task.classes, strict=False)
    ]
    handles.append(Line2D([], [], color="0.2", marker="o", mfc="none", ls="", ms=8, label="simulated"))
    handles.append(Line2D([], [], color="0.2", marker="x", ls="", ms=8, label=f"measured ({outcome.data})"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    figure.suptitle(f"t-SNE of features, {outcome.task.name}, balanced target data, {noise_words(snr_db)}")
    return figure
