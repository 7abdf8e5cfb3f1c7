"""Figures of a study: scores and targets, confusion matrix, rates by effect, rival methods, reliability.

study.json --draw_all--> scores.png, confusion.png, by_effect.png, rivals.png, reliability.png

Colours are from the Okabe-Ito palette (https://jfly.uni-koeln.de/color/); nothing is encoded by colour alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twingap import files
from twingap.study.scores import COMPARED, STRENGTHS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, GREY, BLACK = "#0072B2", "#D55E00", "#009E73", "#999999", "#000000"
_COLOURS = (BLUE, "#E69F00", GREEN, "#CC79A7", "#56B4E9", BLACK, "#F0E442")
_MARKS = "osD^vPX"
FEWEST = 5
"""Worlds from which on a rate is coloured; fewer let chance colour it, more leave cells of rare effects white."""


def draw_all(table: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draw every figure of a study into a folder; returns their paths."""
    drawings: dict[str, Callable[[Mapping[str, Any]], Figure]] = {
        "scores.png": scores, "confusion.png": confusion, "by_effect.png": by_effect, "rivals.png": rivals,
        "reliability.png": reliability,
    }  # fmt: skip
    for name, draw in drawings.items():
        with files.replacing(folder / name) as temporary:
            draw(table).savefig(temporary, dpi=130, metadata={"Software": ""})
    return [folder / name for name in drawings]


def scores(table: Mapping[str, Any]) -> Figure:
    """Every rate that has a target: value, interval, target, and whether it is met."""
    rows = [r for r in table["scores"] if r["target"] and "upper" not in r["score"]]
    rates = [r for r in rows if not r["score"].startswith(("runtime", "peak", "size"))]
    others = [r for r in rows if r not in rates]
    figure = _figure(9.0, 0.42 * len(rows) + 1.8)
    left = figure.subplots(1, 1)
    for y, row in enumerate(rates):
        bound, at_least = _bound(row["target"])
        _reach(left, y, bound, at_least)
        _interval(left, row, y, _verdict(row["met"]))
    words = [f"{r['score']}\n{r['among']} (n {r['n']})" for r in rates]
    left.set_yticks(range(len(rates)), words, fontsize=8)
    left.set_xlim(-0.02, 1.08)
    left.set_ylim(len(rates) - 0.4, -0.6)
    left.set_xlabel("value with exact 95 % interval; line and shade: target and the side that meets it")
    left.grid(axis="x", color="#dddddd", linewidth=0.6)
    left.set_axisbelow(True)
    lines = [
        f"{r['score']} ({r['among']}): {r['value']:.3g} ({r['target']}, {'met' if r['met'] else 'missed'})"
        for r in others if r["value"] is not None
    ]  # fmt: skip
    _title(
        left, table, "Scores against targets\nfilled blue circle: met; open orange square: missed\n" + "\n".join(lines)
    )
    return figure


def confusion(table: Mapping[str, Any]) -> Figure:
    """Confusion matrix of worlds with one effect: true effect against the effect named first, with counts."""
    counts = np.array(table["confusion"]["counts"], float)
    effects, named = table["confusion"]["effects"], table["confusion"]["first_named"]
    figure = _figure(10.5, 9.2)
    axes = figure.subplots(1, 1)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for i, j in zip(*np.nonzero(counts), strict=True):
        colour = "white" if share[i, j] > 0.55 else "black"
        axes.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=8, color=colour,
                  fontweight="bold" if i == j else "normal")  # fmt: skip
    axes.set_xticks(range(len(named)), named, rotation=60, ha="right", fontsize=8)
    axes.set_yticks(range(len(effects)), [f"{e} ({c:.0f})" for e, c in zip(effects, counts.sum(axis=1), strict=True)],
                    fontsize=8)  # fmt: skip
    axes.set_xticks(np.arange(len(named) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(effects) + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="#dddddd", linewidth=0.5)
    axes.tick_params(which="minor", length=0)
    axes.axvline(len(effects) - 0.5, color=BLACK, linewidth=1)
    axes.set_xlabel("named first")
    axes.set_ylabel("the one effect of the world (worlds)")
    right = int(np.trace(counts[:, :-1]))
    _title(
        axes,
        table,
        f"Single effects: {right} of {int(counts.sum())} named correctly; darker: larger fraction of the row",
    )
    return figure


def by_effect(table: Mapping[str, Any]) -> Figure:
    """Counts by effect and strength; cells of at least `FEWEST` worlds are coloured by their rate."""
    panels = ("detected", "first-named right", "exact set", "found in company")
    effects, columns = table["confusion"]["effects"], (*STRENGTHS, "all")
    counts: dict[tuple[str, str, str], tuple[int, int]] = {}
    for row in table["by_effect"]:
        for strength in (row["strength"], "all"):
            key = row["effect"], strength, row["score"]
            k, n = counts.get(key, (0, 0))
            counts[key] = k + row["k"], n + row["n"]
    figure = _figure(11.5, 7.8)
    axes = figure.subplots(1, len(panels), sharey=True)
    for axis, panel in zip(axes, panels, strict=True):
        grid = np.full((len(effects), len(columns)), np.nan)
        for i, effect in enumerate(effects):
            for j, strength in enumerate(columns):
                k, n = counts.get((effect, strength, panel), (0, 0))
                if n >= FEWEST:
                    grid[i, j] = k / n
                colour = "white" if n >= FEWEST and k / n > 0.55 else BLACK
                axis.text(j, i, f"{k}/{n}" if n else "-", ha="center", va="center", fontsize=9, color=colour)
        axis.imshow(grid, cmap="Blues", vmin=0, vmax=1, aspect="auto")
        axis.axvline(len(STRENGTHS) - 0.5, color=BLACK, linewidth=1)
        axis.set_xticks(range(len(columns)), columns, fontsize=9)
        axis.set_yticks(range(len(effects)), effects, fontsize=9)
        alone = "pairs, crowds, outside_plus" if panel == "found in company" else "single, path, lines"
        axis.set_title(f"{panel}\n({alone})", fontsize=10)
    figure.suptitle(
        f"Worlds by missing effect and its strength, {_worlds(table)}: found of all; "
        f"darker: higher rate, coloured from {FEWEST} worlds on; a dash: no such world", fontsize=10,
    )  # fmt: skip
    return figure


def rivals(table: Mapping[str, Any]) -> Figure:
    """Scores of the diagnosis and of its rivals."""
    methods = {"diagnosis": table["scores"], **table["rivals"]}
    chosen = [(r["score"], r["among"]) for r in table["scores"] if r["score"] in COMPARED]
    figure = _figure(10.0, 0.62 * len(chosen) + 2.6)
    axis = figure.subplots(1, 1)
    step = 0.8 / len(methods)
    for m, (method, rows) in enumerate(methods.items()):
        by = {(r["score"], r["among"]): r for r in rows}
        for y, key in enumerate(chosen):
            row, at = by[key], y - 0.4 + step * (m + 0.5)
            if row["value"] is None:
                continue
            axis.plot([row["low"], row["high"]], [at, at], color=_COLOURS[m % 7], linewidth=1.4)
            axis.plot(row["value"], at, _MARKS[m % 7], color=_COLOURS[m % 7], markeredgecolor=BLACK,
                      markeredgewidth=0.4, markersize=7 if m == 0 else 5, clip_on=False,
                      label=method if y == 0 else None)  # fmt: skip
    for y, (name, _) in enumerate(chosen):
        axis.axhline(y + 0.5, color="#dddddd", linewidth=0.6)
        target = next((r["target"] for r in table["scores"] if (r["score"], r["among"]) == chosen[y]), None)
        if target:
            bound, _ = _bound(target)
            axis.plot([bound, bound], [y - 0.45, y + 0.45], color=BLACK, linewidth=1, linestyle=":")
        if name == "false alarms":
            axis.text(1.02, y, "lower is\nbetter", fontsize=7, va="center")
    axis.set_yticks(range(len(chosen)), [f"{name}\n{among}" for name, among in chosen], fontsize=8)
    axis.set_ylim(len(chosen) - 0.5, -0.5)
    axis.set_xlim(-0.02, 1.1)
    axis.set_xlabel("value with exact 95 % interval; dotted: target")
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=8, loc="outside lower center", ncols=2, frameon=False)
    _title(axis, table, "The diagnosis and rival methods on the same worlds")
    return figure


def reliability(table: Mapping[str, Any]) -> Figure:
    """Reliability diagram: predicted probability of an effect against its observed frequency."""
    rows = table["reliability"]
    figure = _figure(5.6, 5.4)
    axis = figure.subplots(1, 1)
    axis.plot([0, 1], [0, 1], color=GREY, linewidth=1, linestyle="--", label="calibrated")
    for row in rows:
        x = row["mean_probability"]
        axis.plot([x, x], [row["low"], row["high"]], color=BLUE, linewidth=1.4)
        axis.plot(x, row["value"], "o", color=BLUE, markersize=6)
        axis.annotate(f"n {row['n']}", (x, row["value"]), (6, -9), textcoords="offset points", fontsize=7)
    axis.set_xlim(-0.03, 1.08)
    axis.set_ylim(-0.03, 1.05)
    axis.set_xlabel("predicted probability (mean of bin)")
    axis.set_ylabel("fraction of these effects that were present, 95 % interval")
    axis.legend(fontsize=8, frameon=False)
    _title(axis, table, "Reliability of probabilities")
    return figure


def _figure(width: float, height: float) -> Figure:
    """A figure outside pyplot's global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _interval(axis: Any, row: Mapping[str, Any], y: float, colour: str) -> None:
    if row["value"] is None:
        axis.text(0.02, y, "no world", fontsize=7, va="center", color=GREY)
        return
    low = 0.0 if row["low"] is None else row["low"]
    high = 1.08 if row["high"] is None else row["high"]
    axis.plot([low, high], [y, y], color=colour, linewidth=1.8)
    missed = colour == ORANGE
    axis.plot(min(row["value"], 1.08), y, "s" if missed else "o", color=colour, markersize=7, clip_on=False,
              markerfacecolor="white" if missed else colour)  # fmt: skip
    axis.annotate(f"{row['value']:.2f}", (min(row["value"], 1.08), y), (0, 6), textcoords="offset points",
                  fontsize=7, ha="center")  # fmt: skip


def _reach(axis: Any, y: float, bound: float, at_least: bool) -> None:
    axis.plot([bound, bound], [y - 0.38, y + 0.38], color=BLACK, linewidth=1.2)
    edges = (bound, 1.08) if at_least else (-0.02, bound)
    axis.fill_betweenx([y - 0.38, y + 0.38], *edges, color=GREY, alpha=0.18, linewidth=0)


def _verdict(met: bool | None) -> str:
    return GREY if met is None else BLUE if met else ORANGE


def _bound(target: str) -> tuple[float, bool]:
    """Value of a target given as text, and whether it is a lower bound."""
    return float(target.split()[-1]), "at least" in target


def _worlds(table: Mapping[str, Any]) -> str:
    about = table["provenance"]
    return f"{about['cases']} worlds, seed {about['seed']}"


def _title(axis: Any, table: Mapping[str, Any], words: str) -> None:
    axis.set_title(f"{words}\n{_worlds(table)}", fontsize=9, loc="left")
