"""Figure of a degradation analysis: indicator, fitted curves with intervals, and errors on later records.

The colours are suitable for colour-blind readers (Okabe and Ito 2008).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from twingap.prognosis.degrade import Degradation

LINES: Final = {
    "constant": ("#666666", ":"), "exponential": ("#E69F00", "--"), "exponential with offset": ("#D55E00", "--"),
    "power": ("#56B4E9", "-."), "polynomial 2": ("#999999", "-."), "polynomial 3": ("#CC79A7", "-."),
    "combined power 3": ("#009E73", "-"), "combined power 5": ("#0072B2", "-"),
}  # fmt: skip
RECORDS: Final = "#AAAAAA"
AHEAD: Final = 0.2
"""Forecast that the figure shows, relative to the duration of the run."""


def degradation_figure(found: Degradation) -> Figure:
    """Figure with two panels: run, curves and forecast; errors on later records over the fraction of the run fitted."""
    import matplotlib as mpl

    with mpl.rc_context({"font.size": 12}):
        figure = Figure(figsize=(12, 9.5), layout="constrained")
        upper, lower = figure.subplots(2, 1, height_ratios=(1.5, 1))
        unit, per = ("h", 3600.0) if found.run.time_s[-1] - found.run.time_s[0] > 7200 else ("s", 1.0)
        _run(upper, found, per)
        upper.set_xlabel(f"time ({unit})")
        upper.set_ylabel(f"{found.indicator} (features in healthy standard deviations)")
        upper.set_title(f"{found.run.name}: {found.preferred} has the lowest BIC with AR(1) residuals")
        _errors(lower, found)
        figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _run(panel: Any, found: Degradation, per: float) -> None:
    t, seen = found.run.time_s, float(found.run.time_s[-1] - found.run.time_s[0])
    times = np.concatenate([
        np.linspace(t[0], t[-1], 300), t[-1] + np.linspace(0, AHEAD * seen, 80)[1:],
    ])  # fmt: skip
    panel.plot(t / per, found.values, ".", ms=3, color=RECORDS, label="records", zorder=1)
    best = found.models[found.preferred]
    level = f"{found.options.level:.0%}"
    colour, _ = LINES[found.preferred]
    records = best.curves.band(times, found.options.level, np.random.default_rng(0))
    panel.fill_between(times / per, *records, color=colour, alpha=0.12, lw=0, label=f"{level} of records", zorder=0)
    curve = best.curves.band(times, found.options.level)
    panel.fill_between(times / per, *curve, color=colour, alpha=0.35, lw=0, label=f"{level} of the curve", zorder=2)
    shown = [found.values.min(), found.values.max()]
    for name, model in found.models.items():
        colour, style = LINES[name]
        wide = 2.8 if name == found.preferred else 1.4
        panel.plot(times / per, model.fit.at(times), style, color=colour, lw=wide, label=name, zorder=3)
    shown += [float(v) for v in np.quantile(best.fit.at(times), [0, 1])]
    if found.limit is not None:
        panel.axhline(found.limit, color="black", lw=1.2, ls=(0, (6, 3)), label="limit")
        shown.append(found.limit)
    panel.axvline(t[-1] / per, color="black", lw=0.8)
    low, high = min(shown), max(shown)
    # The vertical range covers measured values and the limit, extended by half; extrapolations may exceed it.
    seen_levels = [*found.values, *([] if found.limit is None else [found.limit])]
    most = 0.5 * (max(seen_levels) - min(seen_levels))
    low, high = max(low, min(seen_levels) - most), min(high, max(seen_levels) + most)
    panel.set_ylim(low - 0.05 * (high - low), high + 0.08 * (high - low))
    panel.set_xlim(times[0] / per, times[-1] / per)


def _errors(panel: Any, found: Degradation) -> None:
    reach = float(np.ptp(found.trend)) or 1.0
    for name, model in found.models.items():
        colour, style = LINES[name]
        shares, errors = [e.share for e in model.errors], [max(e.rmse_rest / reach, 1e-6) for e in model.errors]
        panel.plot(
            shares, errors, style, color=colour, marker="o", ms=4,
            lw=2.4 if name == found.preferred else 1.4,
        )  # fmt: skip
    panel.set_yscale("log")
    low, high = panel.get_ylim()
    panel.set_ylim(max(low, 1e-4), min(high, 1e3))
    panel.set_xlim(0.05, 0.95)
    panel.grid(color="0.9", which="both")
    panel.set_xlabel("fraction of the run that was fitted")
    panel.set_ylabel("RMSE on later records\n/ range of the trend")


def write_figure(path: Path, found: Degradation) -> None:
    """Write the figure as PNG."""
    degradation_figure(found).savefig(path, dpi=100, format="png", metadata={"Software": "twingap"})
