"""Figures of a diagnosis, interactive, in colours that colour-blind readers can distinguish (Okabe and Ito 2008).

GapReport --all_figures--> name, plotly figure: curves with the places marked, shares, closures, measures

Records are black and solid, the calibrated twin vermilion and dashed, the twin with the verdict's effects blue and
dotted, so that colour is not the only difference.
"""

from __future__ import annotations

import html
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from twingap.gap.distance.domains import DOMAIN
from twingap.gap.report.advice import place_words
from twingap.gap.report.formats import undetermined
from twingap.gap.report.model import Candidate, Curve, GapReport, GroupShare, Metric, Place

REAL: Final = "#000000"
BEFORE: Final = "#D55E00"
AFTER: Final = "#0072B2"
PLACE: Final = "rgba(240, 228, 66, 0.45)"
GREY: Final = "#7a7a7a"
FIRST: Final = ("spectrum", "lines", "envelope", "order", "amplitude", "time", "condition")
"""Order of the curves on the page; others follow."""
MOST_CANDIDATES: Final = 12
MOST_PLACES: Final = 12
_EVERYWHERE: Final = 0.8
"""Part of the axis from which a place is not shaded."""
_NEAR: Final = 0.08
"""Part of the axis below which two marked orders are beside each other: names overlap on a narrow screen."""
MOST_POINTS: Final = 2000
"""Points of a line that the page holds; a longer one is thinned by taking the largest of each stretch."""
_LINES: Final = (
    ("real", "records", REAL, "solid", 2.4),
    ("before", "calibrated twin", BEFORE, "dash", 2.0),
    ("after", "twin with the effects added", AFTER, "dot", 2.4),
)


def all_figures(report: GapReport) -> Iterator[tuple[str, Any]]:
    """Every figure that the report has data for, with its name; curves first."""
    places = report.places
    kinds = {name: name.partition("-")[0] for name in report.curves}  # as of "envelope-outer"
    for name in sorted(kinds, key=lambda name: [*FIRST, kinds[name]].index(kinds[name])):
        yield f"curve-{name}", curve_figure(report.curves[name], places)
    if places:
        yield "shares", shares_figure(places)
    if report.candidates and report.verdict.status != "no_gap":  # closures of no gap mean nothing
        yield "closures", closures_figure(report.candidates, report.verdict.effects)
    if report.closest.attribution:
        yield "attribution", attribution_figure(report.closest.attribution)
    if report.verdict.effects and any(m.closure is not None for m in report.metrics):
        yield "metrics", metrics_figure(report.metrics)


def curve_figure(curve: Curve, places: Sequence[Place] = ()) -> Any:
    """Lines of the records and of the twin before and after, with the places of their domain shaded.

    Places are numbered as in the given sequence, of which those of other domains are left out.
    """
    figure = _figure()
    words = bool(curve.x) and isinstance(curve.x[0], str)
    x: Any = [html.escape(str(v)) for v in curve.x] if words else list(curve.x)
    for name, label, colour, dash, width in _LINES:
        values = getattr(curve, name)
        if values is None:
            continue
        if name in curve.bands and not words:
            at, low, high = _thinned(x, *curve.bands[name])
            figure.add_scatter(x=at, y=low, line_width=0, hoverinfo="skip", showlegend=False, mode="lines")
            figure.add_scatter(
                x=at, y=high, line_width=0, fill="tonexty", fillcolor=_faint(colour), hoverinfo="skip", mode="lines",
                name=f"90 % of the {label}", showlegend=name == "real",
            )  # fmt: skip
        at, line = _thinned(x, values) if not words else (x, list(values))
        hover = f"%{{y:.4g}} {html.escape(curve.y_unit)}"
        if words:  # below each other, in short lines, since the names of conditions are long
            symbol = {"real": "circle", "before": "square", "after": "diamond"}[name]
            marker = {"symbol": symbol, "size": 12, "color": colour}
            own = [str(place).replace(", ", "<br>") for place in at]
            figure.add_scatter(
                x=line, y=own, mode="markers", marker=marker, name=label, hovertemplate=hover.replace("y:", "x:")
            )
        else:
            style = {"color": colour, "dash": dash, "width": width}
            figure.add_scatter(x=at, y=line, mode="lines", line=style, name=label, hovertemplate=hover)
    if not words:
        _mark(figure, curve, places, x)
        _mark_orders(figure, curve)
    values = figure.update_xaxes if words else figure.update_yaxes
    values(title=html.escape(curve.y_unit), type="log" if curve.log_y else "linear", automargin=True)
    if curve.log_y:
        values(exponentformat="power", dtick=1)
    if words:
        figure.update_yaxes(range=[len(x) - 0.4, -0.6], automargin=True)
        return _styled(figure, height=150 + 64 * len(x), top=66)
    figure.update_xaxes(title=html.escape(_AXES.get(curve.x_unit, curve.x_unit)), automargin=True)
    figure.update_layout(hovermode="x unified")
    return _styled(figure, height=430 if curve.domain == "frequency" else 360, top=66)


def shares_figure(places: Sequence[Place]) -> Any:
    """Shares of the gap as bars, coloured alike and numbered as on the curves; each place is named above its bar."""
    shown = list(places[:MOST_PLACES])
    labels = [f"{i}  {_label(p)}" for i, p in enumerate(shown, 1)]
    figure = _figure()
    figure.add_bar(
        x=[100 * p.share for p in shown], y=list(range(len(shown))), orientation="h", width=0.42,
        marker={"color": AFTER}, text=[f"{100 * p.share:.0f} %" for p in shown], textposition="outside",
        cliponaxis=False, customdata=[[of, f"{p.p_value:.2g}"] for of, p in zip(labels, shown, strict=True)],
        hovertemplate="%{customdata[0]}<br>%{x:.1f} % of the gap, p = %{customdata[1]}<extra></extra>",
    )  # fmt: skip
    for place, label in enumerate(labels):
        figure.add_annotation(
            x=0, y=place - 0.2, text=label, showarrow=False, xanchor="left", yanchor="bottom", font={"size": 14}
        )
    figure.update_xaxes(title="share of the gap (%)", range=[0, max(5.0, 118 * shown[0].share)])
    figure.update_yaxes(range=[len(shown) - 0.6, -0.9], showticklabels=False)
    figure = _styled(figure, height=100 + 48 * len(shown), top=10)
    return figure.update_yaxes(ticks="", showgrid=False)


def attribution_figure(shares: Sequence[GroupShare]) -> Any:
    """What each group of effects closes, as bars with 90 % intervals; groups that are not shown to are pale."""
    values = [100 * share.share for share in shares]
    figure = _figure()
    figure.add_bar(
        x=values, y=[html.escape(share.group) for share in shares], orientation="h",
        marker={"color": [AFTER if share.shown else _faint(AFTER) for share in shares]},
        error_x=_errors(values, [share.share_ci for share in shares], type="data", symmetric=False, color=GREY),
        customdata=[html.escape(", ".join(one.effect for one in share.effects)) for share in shares],
        hovertemplate="%{y}: %{x:.0f} % of the gap<br>%{customdata}<extra></extra>",
    )  # fmt: skip
    figure.update_xaxes(title="closes (% of the gap)")
    figure.update_yaxes(autorange="reversed", automargin=True)
    return _styled(figure, height=120 + 36 * len(shares), top=30)


def closures_figure(candidates: Sequence[Candidate], effects: Sequence[str]) -> Any:
    """Closure of each candidate with its 90 % interval, the verdict's effects standing out."""
    tried = [c for c in candidates if c.acts is None] or list(candidates)
    shown = [c for c in tried if c.effect in effects]
    others = [c for c in tried if c.effect not in effects and not undetermined(c.closure_ci)]
    shown += others[: max(MOST_CANDIDATES - len(shown), 0)]
    figure = _figure()
    for named, colour, symbol, label in (
        (True, AFTER, "diamond", "named in the verdict"),
        (False, GREY, "circle-open", "other candidates"),
    ):
        own = [c for c in shown if (c.effect in effects) == named]
        if not own:
            continue
        values = [100 * c.closure for c in own]
        figure.add_scatter(
            x=values, y=[html.escape(c.effect.replace("_", " ")) for c in own], mode="markers", name=label,
            marker={"symbol": symbol, "size": 13, "color": colour, "line": {"width": 2, "color": colour}},
            error_x=_errors(values, [c.closure_ci for c in own], color=colour, thickness=2.5, width=6),
            customdata=[[f"{c.probability:.0%}", *(f"{100 * v:.0f}" for v in c.closure_ci)] for c in own],
            hovertemplate="%{y}: closes %{x:.0f} % (90 %: %{customdata[1]} to %{customdata[2]} %)"
            "<br>probability %{customdata[0]}<extra></extra>",
        )  # fmt: skip
    order = [html.escape(c.effect.replace("_", " ")) for c in shown]
    figure.add_vline(x=0, line={"color": GREY, "width": 1.5})
    figure.add_vline(x=100, line={"color": GREY, "width": 1.5, "dash": "dot"})
    # Intervals may be wild where an effect does nothing; they must not squeeze the rest together.
    low = min(-10.0, *(100 * c.closure for c in shown), *(max(100 * c.closure_ci[0], -60.0) for c in shown))
    high = max(112.0, *(100 * c.closure for c in shown), *(min(100 * c.closure_ci[1], 150.0) for c in shown))
    figure.update_xaxes(title="closes (% of the gap)", nticks=5, range=[max(low, -100.0) - 4, min(high, 200.0)])
    figure.update_yaxes(categoryorder="array", categoryarray=order, autorange="reversed", automargin=True)
    return _styled(figure, height=130 + 34 * len(shown), top=40)


def metrics_figure(metrics: Sequence[Metric]) -> Any:
    """Part of the gap that is left, in every measure: 100 % is the twin before, 0 % the floor."""
    shown = [m for m in metrics if m.closure is not None]
    names = ["<br>".join(map(html.escape, textwrap.wrap(m.metric.replace("_", " "), 24))) for m in shown]
    left = [100 * _left(m, m.after) for m in shown]
    parts = [sorted(_left(m, v) for v in m.ci_after) for m in shown]
    ends = [[100 * v for v in part] for part in parts]
    figure = _figure()
    for name, value in zip(names, left, strict=True):
        figure.add_scatter(
            x=[100, value], y=[name, name], mode="lines", line={"color": "#c9c9c9", "width": 5}, hoverinfo="skip",
            showlegend=False,
        )  # fmt: skip
    figure.add_scatter(
        x=[100.0] * len(shown), y=names, mode="markers", name="before",
        marker={"symbol": "square", "size": 13, "color": BEFORE},
        customdata=[f"{m.before:.4g} {html.escape(m.unit)}" for m in shown],
        hovertemplate="%{y} before: %{customdata}<extra></extra>",
    )  # fmt: skip
    figure.add_scatter(
        x=left, y=names, mode="markers", name="after, with 90 % interval",
        marker={"symbol": "diamond", "size": 14, "color": AFTER},
        error_x=_errors(left, parts, color=AFTER, thickness=2.5, width=6),
        customdata=[f"{m.after:.4g} {html.escape(m.unit)}" for m in shown],
        hovertemplate="%{y} after: %{customdata}, %{x:.0f} % of the gap left<extra></extra>",
    )  # fmt: skip
    figure.add_vline(x=0, line={"color": REAL, "width": 2})
    low, high = min(-12.0, *(max(e[0], -60.0) for e in ends)), max(108.0, *(min(e[1], 180.0) for e in ends), *left)
    figure.update_xaxes(title="gap left (%)", nticks=6, range=[max(low, -100.0) - 3, min(high, 300.0) + 3])
    figure.update_yaxes(categoryorder="array", categoryarray=names, autorange="reversed", automargin=True)
    return _styled(figure, height=140 + 42 * len(shown), top=48)


def _figure() -> Any:
    """An empty figure; plotly is a slow import."""
    import plotly.graph_objects as go

    return go.Figure()


def _errors(values: Sequence[float], parts: Sequence[Sequence[float]], **style: Any) -> dict[str, Any]:
    """Bars from values in per cent to the ends of their intervals, which are parts."""
    above = [max(100 * high - value, 0) for value, (_, high) in zip(values, parts, strict=True)]
    below = [max(value - 100 * low, 0) for value, (low, _) in zip(values, parts, strict=True)]
    return {"array": above, "arrayminus": below, **style}


def _left(metric: Metric, value: float) -> float:
    """Part of the gap between before (1) and floor (0) at a value."""
    return (value - metric.floor) / (metric.before - metric.floor)


def _mark(figure: Any, curve: Curve, places: Sequence[Place], x: Sequence[float]) -> None:
    """Shade the places of the curve's domain and number them; narrow ones are widened to be seen."""
    finite = [v for v in x if v == v]
    if not finite:
        return
    first, last = min(finite), max(finite)
    least = 0.004 * (last - first)
    for number, place in enumerate(places[:MOST_PLACES], 1):
        if place.domain != curve.domain or (place.lo is None and place.hi is None):
            continue
        lo, hi = (first if place.lo is None else place.lo), (last if place.hi is None else place.hi)
        if hi < first or lo > last:
            continue
        middle = (lo + hi) / 2
        lo, hi = max(min(lo, middle - least / 2), first), min(max(hi, middle + least / 2), last)
        everywhere = hi - lo > _EVERYWHERE * (last - first)  # the number alone: a band over all would hide the curves
        figure.add_vrect(
            x0=lo, x1=hi, fillcolor="rgba(0, 0, 0, 0)" if everywhere else PLACE, line={"color": "#b0a000", "width": 1},
            layer="below",
            annotation={"text": f"<b>{number}</b>", "yref": "paper", "y": 0.995, "yanchor": "top", "x": (lo + hi) / 2,
                        "xanchor": "center", "showarrow": False, "font": {"size": 14, "color": "#6b6100"},
                        "hovertext": f"place {number}: {html.escape(place_words(place))}, {100 * place.share:.0f} %"},
        )  # fmt: skip


def _mark_orders(figure: Any, curve: Curve) -> None:
    """Thin lines at the orders that have a name; the names stand at the bottom, where those of places do not, and of
    two lines beside each other on the outer sides."""
    near, before = _NEAR * (float(curve.x[-1]) - float(curve.x[0])), -math.inf
    for name, at in sorted(curve.marks.items(), key=lambda mark: mark[1]):
        anchor = "left" if at - before < near else "right"
        before = at if anchor == "right" else -math.inf
        figure.add_vline(
            x=at, line={"color": GREY, "width": 1, "dash": "dot"}, layer="below",
            annotation={"text": html.escape(name), "textangle": -90, "yref": "paper", "y": 0.02, "yanchor": "bottom",
                        "xanchor": anchor, "x": at, "showarrow": False, "font": {"size": 12, "color": "#5c5c5c"}},
        )  # fmt: skip


def _label(place: Place) -> str:
    words = place_words(place)
    short = html.escape(words if len(words) <= 44 else words[:43] + "…")
    return short if place.domain == "condition" else f"{DOMAIN[place.domain].short_label}: {short}"


_AXES: Final[Mapping[str, str]] = {
    "Hz": "frequency (Hz)", "s": "time within the record (s)", "quantile": "quantile of |x|",
    "shaft orders": "multiples of shaft speed", "condition": "",
}  # fmt: skip
"""Units of curves that deserve a quantity."""


def _thinned(x: Sequence[float], *lines: Sequence[float]) -> tuple[list[float], ...]:
    """At most `MOST_POINTS` points: the largest of each stretch of the first line, so that its peaks stay."""
    step = -(-len(x) // MOST_POINTS)
    if step <= 1:
        return tuple([_short(v) for v in values] for values in (x, *lines))
    lead = [v if v == v else float("-inf") for v in lines[-1]]
    kept = [max(range(i, min(i + step, len(x))), key=lead.__getitem__) for i in range(0, len(x), step)]
    return tuple([_short(values[i]) for i in kept] for values in (x, *lines))


def _short(value: float) -> float:
    """Five digits, more than a screen shows."""
    return float(f"{value:.5g}")


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, 0.13)"


def _styled(figure: Any, height: int, top: int) -> Any:
    figure.update_layout(
        template="none", height=height, margin={"l": 20, "r": 24, "t": top, "b": 60},
        font={"family": "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif", "size": 15},
        legend={"orientation": "h", "traceorder": "normal", "yanchor": "bottom", "y": 1, "x": 0, "font": {"size": 14}},
        hoverlabel={"font": {"size": 14}}, paper_bgcolor="rgba(0, 0, 0, 0)", plot_bgcolor="rgba(0, 0, 0, 0)",
    )  # fmt: skip
    axis = {
        "showgrid": True, "gridcolor": "#ececec", "zeroline": False, "showline": True, "linecolor": "#242424",
        "ticks": "outside", "tickcolor": "#242424", "title_standoff": 12,
    }  # fmt: skip
    figure.update_xaxes(axis, tickangle=0)
    figure.update_yaxes(axis)
    return figure
