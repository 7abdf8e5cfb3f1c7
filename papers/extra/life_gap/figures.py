"""The gap by stage of life and speed, before and after what the diagnosis names is added."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.figures import rule, subplots
from papers.framework import Work

BEFORE, AFTER = "#D55E00", "#0072B2"


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    yield "life_gap", gaps(work.tables["life_gap"])


def gaps(told: pd.DataFrame) -> Figure:
    """A panel per data set, a group per stage: the gap as it is, with the named effects, and its floor."""
    sets = [own for _, own in told[told["gap_before"].notna()].groupby("data", sort=False)]
    count = max(len(sets), 1)
    figure, panels = subplots((6.4 * count, 4.8), 1, count, squeeze=False)
    for axes, own in zip(panels[0], sets, strict=False):
        several = own[own["speed"] != "all"]  # those of single runs have no place on the axis
        stages = [stage for _, stage in several.groupby("stage", sort=False)]
        grouped = pd.concat(stages)
        x: list[float] = []
        for stage in stages:
            begin = x[-1] + 2 if x else 0
            x += [begin + k for k in range(len(stage))]
            axes.text(
                begin + (len(stage) - 1) / 2, 1.01, stage["stage"].iloc[0], transform=axes.get_xaxis_transform(),
                ha="center", va="bottom",
            )  # fmt: skip
        at = np.array(x)
        axes.vlines(at, grouped["gap_after"], grouped["gap_before"], color="0.75", lw=2)
        axes.plot(at, grouped["gap_before"], "o", color=BEFORE, ms=9, label="as it is")
        axes.plot(at, grouped["gap_after"], "s", color=AFTER, ms=8, mfc="none", mew=2, label="effects added")
        axes.plot(at, grouped["floor"], "_", color="0.2", ms=16, mew=2, label="floor: records against records")
        axes.set_xticks(at, [f"cond. {w}" if w.isdigit() else w.replace("middle", "mid") for w in grouped["speed"]])
        axes.set_ylim(bottom=0)
        axes.set_ylabel("overall gap")
        axes.set_xlabel(grouped["data"].iloc[0], labelpad=8)
        rule(axes, "y")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure
