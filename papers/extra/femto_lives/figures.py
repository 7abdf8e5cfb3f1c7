"""Errors on FEMTO's runs by twin: as printed, with the named effects, closed; and of the simulated lives alone."""

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.extra.femto_lives.tables import AS_PRINTED, CLOSED, NAMED
from papers.figures import rule, subplots
from papers.framework import Work

MARKS: Final = {AS_PRINTED: ("#D55E00", "o", -0.22), NAMED: ("#0072B2", "s", 0.0), CLOSED: ("#009E73", "^", 0.22)}


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    yield "femto_lives", lives(work.tables["femto_lives_rmse"], work.tables["femto_lives"])


def lives(every: pd.DataFrame, runs: pd.DataFrame) -> Figure:
    """A row of panels per wait, a panel per model: RMSE of each run by twin, seeds as whiskers from least to most."""
    waits, models = list(dict.fromkeys(every["wait_min"])), list(dict.fromkeys(every["model"]))
    figure, panels = subplots(
        (5.6 * len(models) + 1, 3.7 * len(waits) + 0.8), len(waits), len(models), squeeze=False, sharey="row"
    )
    for line, wait in zip(panels, waits, strict=True):
        known = runs[(runs["wait_min"] == wait) & runs["lives_rmse_min"].notna()]
        at = np.arange(len(known))
        for axes, model in zip(line, models, strict=True):
            own = every[(every["wait_min"] == wait) & (every["model"] == model)]
            for twin, (colour, mark, aside) in MARKS.items():
                seeds = own[own["twin"] == twin].groupby("bearing")["rmse_min"]
                mean, least, most = (
                    s.reindex(known["bearing"]).to_numpy() for s in (seeds.mean(), seeds.min(), seeds.max())
                )
                axes.vlines(at + aside, least, most, color=colour, lw=2)
                axes.plot(at + aside, mean, mark, color=colour, ms=8, label=twin)
            axes.plot(at, known["lives_rmse_min"], "_", color="0.2", ms=26, mew=2, label="simulated lives, no network")
            axes.set_xticks(at, [name.removeprefix("Bearing") for name in known["bearing"]])
            axes.set_xlim(-0.6, len(known) - 0.4)
            axes.set_ylim(bottom=0)
            axes.set_title(f"{model}, {wait:g} min after the alarm")
            rule(axes, "y")
        line[0].set_ylabel("RMSE, min")
    for axes in panels[-1]:
        axes.set_xlabel("FEMTO bearing")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=2.4)
    return figure
