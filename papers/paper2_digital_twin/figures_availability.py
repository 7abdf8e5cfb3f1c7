"""Figures of the availability study, in colours that colour-blind readers tell apart (Okabe and Ito 2008).

accuracy over labelled records --> crossing points;  alarms --> severity by recording;  images --> what the network sees
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from papers.paper2_digital_twin.availability_jobs import baseline_of, strips
from papers.paper2_digital_twin.availability_records import TITLES, Measured
from papers.paper2_digital_twin.availability_split import ALL, SPLITS
from papers.paper2_digital_twin.availability_study import Study
from papers.paper2_digital_twin.tables_availability import METHODS, by_seed, calls, judging
from papers.paper3_zoa_dann.figures_identification import SIZES as SIZES
from twingap.adapt.evaluate import t_interval

LOOKS: Final = {
    "twin network": ("#0072B2", "o", "-"), "SVM": ("#D55E00", "s", "--"), "SOM-MQE": ("#009E73", "^", ":"),
}  # fmt: skip
FAULTS: Final = {"healthy": "#666666", "inner": "#D55E00", "outer": "#0072B2", "ball": "#009E73"}


def all_figures(study: Study) -> Iterator[tuple[str, Figure]]:
    """Every figure with its name."""
    import matplotlib as mpl

    with mpl.rc_context(SIZES):
        yield "availability-crossings", crossings(study)
        yield "availability-severity", severity(study)
        for name, data in study.data.items():
            yield f"availability-images-{name}", what_is_seen(study, data)


def crossings(study: Study) -> Figure:
    """Accuracy over labelled records of each fault: mean over seeds and its 95 % interval."""
    found = by_seed(calls(study))
    rows = len(study.data)
    figure = Figure(figsize=(12, 4.4 * rows + 0.8), layout="constrained")
    panels = figure.subplots(rows, len(SPLITS), squeeze=False, sharey=True, sharex=True)
    steps = [0, *study.options.counts, ALL]
    for row, name in enumerate(study.data):
        for column, split in enumerate(SPLITS):
            panel = panels[row, column]
            here = found[(found["data"] == name) & (found["split"] == split)]
            for number, method in enumerate(METHODS):
                colour, marker, line = LOOKS[method]
                mine = here[here["method"] == method]
                places, middle, low, high = [], [], [], []
                for place, count in enumerate(steps):
                    values = list(mine[mine["records"] == count]["accuracy"])
                    if not values:
                        continue
                    places.append(place + 0.08 * (number - 1))
                    middle.append(100 * float(np.mean(values)))
                    ends = t_interval(values, 0.95) if len(values) > 1 else (np.nan, np.nan)
                    low.append(middle[-1] - 100 * ends[0])
                    high.append(100 * ends[1] - middle[-1])
                spread = np.nan_to_num(np.maximum([low, high], 0))
                panel.errorbar(
                    places, middle, yerr=spread, color=colour, marker=marker, linestyle=line, capsize=3,
                    label="network from the twin" if method == METHODS[0] else method,
                )  # fmt: skip
            panel.set_xticks(range(len(steps)), ["all" if c == ALL else str(c) for c in steps])
            panel.set_title(f"{TITLES[name]}, split by {split}")
            panel.grid(alpha=0.3)
            panel.set_ylim(20, 103)
            if row == rows - 1:
                panel.set_xlabel("labelled records of each fault")
            if column == 0:
                panel.set_ylabel("recordings called right, %")
    panels[0, 0].legend(loc="lower right")
    return figure


def severity(study: Study) -> Figure:
    """MQE over threshold of each recording, by fault and size."""
    figure = Figure(figsize=(12, 4.2 * len(study.data) + 0.5), layout="constrained")
    panels = figure.subplots(len(study.data), 1, squeeze=False)[:, 0]
    for panel, (name, data) in zip(panels, study.data.items(), strict=True):
        groups = sorted({(data.labels[r], data.sizes[r]) for r in data.recordings})
        for place, (label, size) in enumerate(groups):
            own = sorted(
                (r for r in data.recordings if (data.labels[r], data.sizes[r]) == (label, size)),
                key=lambda r: data.speeds_rpm[r],
            )
            for offset, r in zip(np.linspace(-0.25, 0.25, len(own)) if len(own) > 1 else [0.0], own, strict=True):
                here = judging(study, data, r)
                values = [
                    float(np.mean([v["recordings"][r][k] / v["threshold"] for v in here]))
                    for k in ("mqe low", "mqe", "mqe high")
                ]
                colour = FAULTS[data.classes[label]]
                panel.plot([place + offset] * 2, [values[0], values[2]], color=colour, linewidth=2)
                panel.plot(place + offset, values[1], "o", color=colour, markersize=6)
        panel.axhline(1, color="black", linestyle="--", linewidth=1)
        panel.text(len(groups) - 0.5, 1, f"alarm, {study.options.false_alarm:.0%} a window", ha="right", va="bottom")
        unit = "deg" if name == "hit_sm" else "in"
        names = [data.classes[c] + ("" if data.classes[c] == "healthy" else f"\n{s:g} {unit}") for c, s in groups]
        panel.set_xticks(range(len(groups)), names)
        panel.set_yscale("log")
        panel.set_ylabel("MQE over threshold")
        panel.set_title(
            f"{TITLES[name]}: median and middle 80 % of windows unseen by the map; speed rises to the right"
        )
        panel.grid(alpha=0.3, axis="y")
    return figure


def what_is_seen(study: Study, data: Measured) -> Figure:
    """The lines channel of one recording of each bearing: envelope order by carrier."""
    image = study.options.image
    baseline = baseline_of(data, ())
    first: dict[tuple[int, float], str] = {}
    for r in data.recordings:
        first.setdefault((data.labels[r], data.sizes[r]), r)
    chosen = [first[key] for key in sorted(first)]
    columns = 4
    rows = -(-len(chosen) // columns)
    figure = Figure(figsize=(15, 2.7 * rows + 0.8), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    carriers = image.carriers_hz(data.fs_hz) / 1000
    drawn = None
    for panel in panels.flat[len(chosen) :]:
        panel.set_visible(False)
    for panel, r in zip(panels.flat, chosen, strict=False):
        seen = strips(data, r, baseline, image, 6)[:, 1].mean(axis=0)
        drawn = panel.pcolormesh(image.orders, carriers, seen, cmap="cividis", vmin=-0.5, vmax=2, shading="nearest")
        for fault, name in (("outer", "BPFO"), ("inner", "BPFI")):
            order = data.bearing.fault_order(fault)
            panel.axvline(order, color=FAULTS[fault], linewidth=1.2, linestyle="--")
            panel.text(order, carriers[-1], name, color="white", fontsize=10, ha="center", va="top", rotation=90)
        panel.set_title(f"{data.bearings[r]} ({r})")
        panel.set_yscale("log")
        panel.set_yticks([1, 2, 4], ["1", "2", "4"])
        panel.minorticks_off()
    for column in range(columns):
        lowest = panels[(len(chosen) - 1 - column) // columns, column]
        lowest.set_xlabel("envelope order")
        lowest.tick_params(labelbottom=True)
    for panel in panels[:, 0]:
        panel.set_ylabel("carrier, kHz")
    if drawn is not None:
        figure.colorbar(drawn, ax=panels, label="line over floor, log10")
    figure.suptitle(f"{TITLES[data.name]}: order spectra of scalogram rows")
    return figure
