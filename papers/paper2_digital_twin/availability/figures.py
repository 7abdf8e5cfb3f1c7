"""Figures of the availability study, in colours that colour-blind readers tell apart (Okabe and Ito 2008)."""

from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.figures import name_axes, subplots
from papers.framework import Work
from papers.paper2_digital_twin.availability.records import SPLITS, TITLES
from papers.paper2_digital_twin.availability.tables import LEVELS, METHODS, unseen

LOOKS: Final = {
    "twin network": ("#0072B2", "o", "-"), "SVM": ("#D55E00", "s", "--"), "SOM-MQE": ("#009E73", "^", ":"),
}  # fmt: skip
FAULTS: Final = {"healthy": "#666666", "inner": "#D55E00", "outer": "#0072B2", "ball": "#009E73"}


def crossings(accuracy: pd.DataFrame, crossed: pd.DataFrame) -> Figure:
    """Accuracy over labelled records of each fault, with 95 % intervals over seeds; rings where methods cross."""
    accuracy = accuracy.assign(records=accuracy["records a fault"].astype(str))
    crossed = crossed.assign(start=crossed["at least as good from"].fillna("").astype(str))
    steps, titles = list(dict.fromkeys(accuracy["records"])), list(dict.fromkeys(accuracy["data"]))
    figure, panels = subplots(
        (12, 4.4 * len(titles) + 0.8), len(titles), len(SPLITS), squeeze=False, sharey=True, sharex=True
    )
    for row, title in enumerate(titles):
        for column, split in enumerate(SPLITS):
            panel = panels[row, column]
            here = accuracy[(accuracy["data"] == title) & (accuracy["split by"] == split)]
            for number, method in enumerate(METHODS):
                colour, marker, line = LOOKS[method]
                mine = here[here["method"] == method]
                places = [steps.index(count) + 0.08 * (number - 1) for count in mine["records"]]
                middle, low, high = (100 * mine[name].to_numpy(dtype=float) for name in ("accuracy", "low", "high"))
                panel.errorbar(
                    places, middle, yerr=np.nan_to_num(np.maximum([middle - low, high - middle], 0)), color=colour,
                    marker=marker, linestyle=line, capsize=3,
                    label="network from the twin" if method == METHODS[0] else method,
                )  # fmt: skip
            _mark(panel, here, crossed[(crossed["data"] == title) & (crossed["split by"] == split)], steps)
            panel.set_xticks(range(len(steps)), steps)
            panel.set_title(f"{title}, split by {split}")
            panel.grid(alpha=0.3)
            panel.set_ylim(20, 103)
    name_axes(panels, "labelled records of each fault", "recordings called right, %")
    panels[0, 0].legend(loc="lower right")
    return figure


def _mark(panel: Any, accuracy: pd.DataFrame, crossed: pd.DataFrame, steps: list[str]) -> None:
    """Rings where a method is at least as good as the network from there on, and what crosses in words."""
    said = []
    for row in crossed[crossed["against"] == METHODS[0]].to_dict("records"):
        at = accuracy[(accuracy["method"] == row["method"]) & (accuracy["records"] == row["start"])]
        if at.empty:
            said.append(f"{row['method']} stays below")
            continue
        place = steps.index(row["start"]) + 0.08 * (METHODS.index(row["method"]) - 1)
        panel.plot(place, 100 * at["accuracy"].iloc[0], "o", markersize=16, fillstyle="none", color="black")
        said.append(f"{row['method']} level from {row['start']}")
    panel.text(0.02, 0.03, "\n".join(said), transform=panel.transAxes, va="bottom", fontsize="small")


def severity(work: Work) -> Figure:
    """MQE over threshold of each recording, by fault and size."""
    figure, panels = subplots((12, 4.2 * len(work["data"]) + 0.5), len(work["data"]), squeeze=False)
    found = unseen(work).sort_values("speed, rpm", kind="stable")
    for panel, name in zip(panels[:, 0], work["data"], strict=True):
        groups = list(found[found["set"] == name].groupby(["label", "class", "size"], dropna=False))
        for place, ((_, fault, _), own) in enumerate(groups):
            at = place + (np.linspace(-0.25, 0.25, len(own)) if len(own) > 1 else np.zeros(1))
            low, middle, high = (own[f"{level} over"].to_numpy() for level in LEVELS)
            panel.plot([at, at], [low, high], color=FAULTS[fault], linewidth=2)
            panel.plot(at, middle, "o", color=FAULTS[fault], markersize=6)
        panel.axhline(1, color="black", linestyle="--", linewidth=1)
        panel.text(len(groups) - 0.5, 1, f"alarm, {work.options.false_alarm:.0%} a window", ha="right", va="bottom")
        unit = "deg" if name == "hit_sm" else "in"
        names = [fault if fault == "healthy" else f"{fault}\n{size:g} {unit}" for (_, fault, size), _ in groups]
        panel.set_xticks(range(len(groups)), names)
        panel.set(yscale="log", ylabel="MQE over threshold")
        panel.set_title(
            f"{TITLES[name]}: median and middle 80 % of windows unseen by the map; speed rises to the right"
        )
        panel.grid(alpha=0.3, axis="y")
    return figure
