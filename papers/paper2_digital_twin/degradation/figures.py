"""Figures of the degradation study, counterparts of the paper's figures 13 to 19 and one of its own.

raw run --> 13 waveform, 14 spectral kurtosis;  the paper's run --> 15 fusion features, 16 scatter, 17 indicator,
18 exponential, 19 combined power;  all runs --> errors on later records
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from papers.figures import grid, subplots
from papers.framework import Work
from papers.paper2_digital_twin.degradation.candidates import Judged
from papers.paper2_digital_twin.degradation.tables import COMBINED, EXPONENTIALS, shown
from twingap.prognosis import MODELS, offline_indicators
from twingap.prognosis.degradation_figure import LINES
from twingap.prognosis.indicator_criteria import causal_trend

RECORDS, TREND, MARK = "#AAAAAA", "#0072B2", "#D55E00"
SHOWN_MODELS: Final = ("exponential with offset", "combined power 3", "combined power 5", "polynomial 3", "constant")
LEAST, MOST = 1e-3, 1e3


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    own = shown(work)
    there = [j for j in work["judged"] if j.run.extremes is not None]
    if there:
        raw = next((j for j in there if j.run.name == work.options.raw_run), there[0])
        yield "degradation-13-waveform", waveform(raw)
        yield "degradation-14-spectral-kurtosis", spectral_kurtosis_map(raw)
    yield "degradation-15-fusion-features", fusion_features(own)
    if "fusion 9" in offline_indicators(own.run.run).values:
        yield "degradation-16-fusion-9-and-others", fusion_scatter(own)
    yield "degradation-17-indicator", indicators(own)
    yield "degradation-18-exponential", fitted(work, EXPONENTIALS)
    yield "degradation-19-combined-power", fitted(work, COMBINED)
    yield "degradation-errors", errors(work)


def waveform(j: Judged) -> Figure:
    """Least and greatest sample of each record along the run."""
    assert j.run.extremes is not None
    hours = j.run.whole.time_s / 3600
    figure, panel = subplots((10, 4.4))
    panel.fill_between(hours, j.run.extremes[:, 0], j.run.extremes[:, 1], color=TREND, lw=0.3, step="mid")
    panel.set(xlabel="running time (h)", ylabel=f"acceleration ({'unit not stated' if j.run.family == 'IMS' else 'g'})")
    panel.set(xlim=(hours[0], hours[-1]), title=f"{j.run.name}: least and greatest sample of each record")
    return figure


def spectral_kurtosis_map(j: Judged) -> Figure:
    """Spectral kurtosis over time and frequency; logarithmic above 1, since late transients dwarf all else."""
    from matplotlib.colors import SymLogNorm

    assert j.run.kurtosis_map is not None
    time_s, frequency_hz, values = j.run.kurtosis_map
    figure, panel = subplots((10, 4.8))
    image = panel.pcolormesh(
        time_s / 3600, frequency_hz / 1e3, values.T, cmap="cividis", shading="nearest", rasterized=True,
        norm=SymLogNorm(1.0, vmin=-0.5, vmax=max(float(np.quantile(values, 0.999)), 1.0)),
    )  # fmt: skip
    bar = figure.colorbar(image, ax=panel, label="spectral kurtosis", ticks=[-0.5, 0, 0.5, 1, 2, 5, 10, 20, 50])
    bar.ax.set_yticklabels([f"{tick:g}" for tick in bar.get_ticks()])
    title = f"{j.run.name}: spectral kurtosis, Gaussian noise is 0"
    panel.set(xlabel="running time (h)", ylabel="frequency (kHz)", title=title)
    return figure


def fusion_features(j: Judged) -> Figure:
    """The paper's reading: every fusion feature over the run, learnt from all of it."""
    made = offline_indicators(j.run.run)
    fused = {name: x for name, x in made.values.items() if name.startswith("fusion ")}
    share = made.fusion.variance / made.fusion.variance.sum()
    figure, panels = grid(len(fused), 5, (3.4, 2.5), (0.0, 0.8), sharex=True)
    hours = j.run.run.time_s / 3600
    for panel, (name, x), part in zip(panels.flat, fused.items(), share, strict=False):
        panel.plot(hours, x, ".", ms=2, color=RECORDS)
        panel.plot(hours, causal_trend(x, j.run.trend_rows), color=MARK if name == "fusion 9" else TREND, lw=1.5)
        panel.set_title(f"{name}: {100 * part:.2g} %")
    for panel in panels.flat[max(len(fused) - 5, 0) : len(fused)]:
        panel.set_xlabel("running time (h)")
    figure.suptitle(f"{j.run.name} ({j.run.source}): normalised by the whole run; share of variance in percent")
    return figure


def fusion_scatter(j: Judged) -> Figure:
    """Fusion feature 9 against those after it; colour is time."""
    made = offline_indicators(j.run.run).values
    others = [f"fusion {k}" for k in range(10, 16) if f"fusion {k}" in made]
    figure, panels = grid(len(others), 3, (13 / 3, 3.8), (0.0, 0.0))
    hours = j.run.run.time_s / 3600
    for panel, name in zip(panels.flat, others, strict=False):
        points = panel.scatter(made[name], made["fusion 9"], c=hours, s=6, cmap="cividis", rasterized=True)
        panel.set(xlabel=name, ylabel="fusion 9")
    if others:
        figure.colorbar(points, ax=panels, label="running time (h)")
    figure.suptitle(f"{j.run.name} ({j.run.source}): whole run, ordered by variance")
    return figure


def indicators(j: Judged) -> Figure:
    """Every indicator that curves were fitted to."""
    figure, panels = grid(len(j.series), 1, (11, 2.5), (0.0, 0.6), sharex=True)
    for panel, (name, x) in zip(panels.flat, j.series.items(), strict=True):
        hours = j.times[name] / 3600
        panel.plot(hours, x, ".", ms=2.5, color=RECORDS, label="record")
        panel.plot(hours, causal_trend(x, j.run.trend_rows), color=TREND, lw=1.8, label="causal moving average")
        panel.axvspan(0, hours[j.run.healthy_rows], color="#009E73", alpha=0.12, lw=0, label="taken to be healthy")
        shown = f"{name}: {j.choice}" if name == "chosen on other runs" else name
        panel.set(title=shown + ("" if "whole run" in name else " (learnt from the healthy start)"), ylabel="indicator")
    panels[-1, 0].set_xlabel("running time (h)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.suptitle(f"{j.run.name} ({j.run.source})")
    return figure


def fitted(work: Work, models: tuple[str, ...]) -> Figure:
    """Two models on every indicator of the paper's run, R2 in the legend."""
    j = shown(work)
    figure, panels = grid(len(j.series), 1, (11, 2.7), (0.0, 0.6), sharex=True)
    for panel, (name, x) in zip(panels.flat, j.series.items(), strict=True):
        t = j.times[name]
        u = (t - t[0]) / (t[-1] - t[0])
        (found,) = (r.value for r in work["analyses"] if (r.job.run, r.job.indicator) == (j.run.name, name))
        panel.plot(t / 3600, x, ".", ms=2.5, color=RECORDS)
        for model in models:
            colour, style = LINES[model]
            fit = found[model]
            curve = MODELS[model].curve(u, np.array(fit["coefficients"], float), tuple(fit["exponents"]))
            label = f"{model}, $R^2$ = {fit['r2']:.2f}"
            panel.plot(t / 3600, curve, style, color=colour, lw=2.4, label=label)
        panel.set(title=name, ylabel="indicator")
        panel.legend(loc="best")
    panels[-1, 0].set_xlabel("running time (h)")
    figure.suptitle(f"{j.run.name} ({j.run.source}): {', '.join(MODELS[m].formula for m in models)}")
    return figure


def errors(work: Work) -> Figure:
    """RMS as indicator: error on all later records against the share of life fitted, every run."""
    table = work.tables["degradation-errors"]
    table = table[(table["indicator"] == "rms") & (table["fit"] == "squares")]
    figure, panels = grid(len(work["judged"]), 4, (4.3, 3.4), (0.0, 1.0))
    for panel, j in zip(panels.flat, work["judged"], strict=False):
        here = table[table["run"] == j.run.name]
        for model in SHOWN_MODELS:
            own = here[here["model"] == model]
            colour, style = LINES[model]
            values = own["rest / range"].clip(LEAST, 2 * MOST)
            panel.plot(own["share of life"], values, style, color=colour, lw=2, marker="o", ms=4, label=model)
        panel.set_yscale("log")
        low = float(here[here["model"].isin(SHOWN_MODELS)]["rest / range"].min())
        panel.set(ylim=(low / 2, MOST), title=j.run.name)
        panel.grid(color="0.9")
        panel.set(xlabel="share of life fitted", ylabel="RMSE / range")
    figure.suptitle(f"Errors on all later records, indicator: RMS ({work.title}); beyond {MOST:g} cut off")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure
