"""Errors of remaining life on the FEMTO runs, by bearing and method."""

from collections.abc import Iterator
from typing import Final

import pandas as pd
from matplotlib.figure import Figure

from papers.figures import rule, subplots
from papers.framework import Work

STYLES: Final = {
    "twingap rul --prior": ("#0072B2", "o"),
    "twingap rul": ("#56B4E9", "s"),
    "exponential": ("#E69F00", "^"),
    "particle filter": ("#CC79A7", "D"),
    "random forest": ("#009E73", "v"),
}
"""Method -> colour and marker, which tells them apart without colours."""


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    yield "femto", errors(work.tables["femto"])


def errors(every: pd.DataFrame) -> Figure:
    """RMSE after the alarm of each method on each bearing."""
    figure, axes = subplots((9.5, 4.4))
    bearings = list(dict.fromkeys(every["bearing"]))
    for place, (method, (colour, marker)) in enumerate(STYLES.items()):
        own = every[every["method"] == method].set_index("bearing")["rmse_s"].reindex(bearings)
        x = [i + 0.13 * (place - 2) for i in range(len(bearings))]
        axes.plot(x, own / 60, marker, color=colour, markersize=8, label=method)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xticks(range(len(bearings)), bearings)
    axes.set_ylabel("RMSE of remaining time\nafter the alarm (min)")
    axes.set_title("FEMTO learning bearings (runs used in development)")
    rule(axes, "y")
    figure.legend(loc="outside lower center", ncols=5)
    return figure
