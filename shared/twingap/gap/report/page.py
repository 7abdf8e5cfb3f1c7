"""report.html: a diagnosis as one page that needs nothing beside it.

GapReport --page--> verdict, where, which, how far, what is left, the closest twin, what to do next; figures by plotly,
                    embedded once

The page opens offline and asks nothing of the network. Whatever comes from the user's data is escaped. Its bytes
depend on the report alone; the run time, which differs between equal runs, stands in gap.json only.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from twingap.effects import catalogue
from twingap.gap.report.advice import condition_words, contradictions, next_steps, place_words, snippet, undecided
from twingap.gap.report.figures import all_figures
from twingap.gap.report.model import GapReport, Metric, ParameterValue, Place, Verdict, count_words, listed

_TITLES: Final[Mapping[str, tuple[str, str]]] = {
    "no_gap": ("No gap", "#009E73"),
    "explained": ("Gap explained", "#0072B2"),
    "partly_explained": ("Gap partly explained", "#E69F00"),
    "unexplained": ("Gap unexplained", "#D55E00"),
}
_MEANING: Final[Mapping[str, str]] = {
    "no_gap": "No gap beyond chance was found.",
    "explained": "Nothing significant is left once the named effects are added.",
    "partly_explained": "A significant rest remains once the named effects are added.",
    "unexplained": "There is a significant gap, and nothing in the catalogue shrinks it significantly.",
}
_DOMAINS: Final[Mapping[str, str]] = {
    "frequency": "spectrum",
    "envelope_order": "envelope spectrum",
    "order": "order spectrum",
    "amplitude": "amplitude distribution",
    "time": "time within the record",
    "condition": "operating condition",
}
_MOST_PLACES: Final = 12
"""Places that are listed at once; others unfold."""
_MOST_EXPLANATIONS: Final = 8
"""Explanations that are listed at once; others unfold."""
_CONFIG: Final = {
    "displaylogo": False,
    "responsive": True,
    "displayModeBar": "hover",
    "modeBarButtons": [["toImage", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
}


def page(report: GapReport) -> str:
    """The whole page; any part of the report may be empty."""
    from plotly.offline import get_plotlyjs

    figures = {name: _figure(name, figure) for name, figure in all_figures(report)}
    sections = [
        _curves(report, figures),
        _where(report, figures),
        _which(report, figures),
        _confidence(report),
        _shrink(report, figures),
        _rest(report),
        _stand_ins(report),
        _next(report),
        _calibration(report),
        _notes(report),
        _provenance(report),
    ]
    title = f"{_TITLES[report.verdict.status][0]}: {_records(report)}"
    library = f"<script>{get_plotlyjs()}</script>" if figures else ""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        # The page is whole: a browser that honours this asks the network for nothing, whatever a name may hold.
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline' "
        "'unsafe-eval' blob:; style-src 'unsafe-inline'; img-src data: blob:; font-src data:\">\n"
        f"<title>{html.escape(title)}</title>\n<style>{_STYLE}</style>\n{library}\n</head>\n<body>\n<main>\n"
        + _verdict(report)
        + _contents(sections)
        + "\n".join(filter(None, sections))
        + "\n</main>\n</body>\n</html>\n"
    )


def _figure(name: str, figure: Any) -> str:
    place = "fig-" + "".join(c if c.isascii() and c.isalnum() else "-" for c in name)
    drawn = figure.to_html(full_html=False, include_plotlyjs=False, div_id=place, config=_CONFIG)
    return f'<figure class="{"wide" if name == "curve-spectrum" else "plot"}">{drawn}</figure>'


def _closing(verdict: Verdict) -> str:
    """What the closure allows to be said: names come from what records show, not from how far the gap shrinks."""
    if not verdict.effects:
        return ""
    if verdict.closure is None or verdict.closure_ci is None:
        return "They show in the records, but cannot be added to what the simulator has made. "
    low, high = verdict.closure_ci
    if low > 0:
        return "They shrink the gap significantly. "
    if high < 0:
        return "They show in the records, but at the values found they widen the gap: look at the values. "
    return "They show in the records; by how much they shrink the gap is too uncertain to say. "


def _verdict(report: GapReport) -> str:
    verdict = report.verdict
    word, colour = _TITLES[verdict.status]
    facts = [("p-value of no gap", _p(verdict.p_value))]
    if verdict.closure is not None:
        facts.append(("gap closed", _percent(verdict.closure, verdict.closure_ci)))
    held_out, total = report.provenance.get("n_held_out"), report.provenance.get("n_records")
    if total is not None:
        facts.append(("records", f"{total}" + (f", judged on {held_out}" if held_out is not None else "")))
    tests = "".join(f"<li>{html.escape(t.name)}: {t.statistic:.4g}, p = {_p(t.p_value)}</li>" for t in report.tests)
    return (
        f'<header style="border-color:{colour}"><p class="status"><span style="background:{colour}"></span>{word}</p>'
        f"<h1>{html.escape(report.sentence)}</h1><p>{_MEANING[verdict.status]} {_closing(verdict)}"
        f"Records: <b>{html.escape(_records(report))}</b>.</p>"
        + "<dl>"
        + "".join(f"<div><dt>{name}</dt><dd>{html.escape(value)}</dd></div>" for name, value in facts)
        + "</dl>"
        + "".join(f'<p class="careful">{html.escape(line)}</p>' for line in contradictions(report))
        + (
            f'<p class="small">Overall tests of records against twin:</p><ul class="small">{tests}</ul>'
            if tests
            else ""
        )
        + "</header>"
    )


def _curves(report: GapReport, figures: Mapping[str, str]) -> str:
    curves = {name: text for name, text in figures.items() if name.startswith("curve-")}
    if not curves:
        return ""
    drawn = "".join(
        f"<div><h3>{html.escape(report.curves[n.removeprefix('curve-')].title)}</h3>{t}</div>"
        for n, t in curves.items()
    )
    return _section(
        "Before and after",
        "Medians over held-out records. Yellow bands are the places where the gap is significant, numbered as in the "
        "table below. Drag to zoom, double-click to zoom out.",
        drawn,
    )


def _where(report: GapReport, figures: Mapping[str, str]) -> str:
    if not report.places:
        return _section("Where the gap lies", "No place differs significantly (family-wise error 5 %).")
    return _section(
        "Where the gap lies",
        "Significant places only (family-wise error 5 %), largest share of the whole gap first.",
        figures.get("shares", "") + _places(report.places),
    )


def _which(report: GapReport, figures: Mapping[str, str]) -> str:
    if not report.candidates:
        return ""
    rows = []
    nothing = report.verdict.status == "no_gap"  # closures of no gap mean nothing
    for c in report.candidates:
        parameters = "<br>".join(f"{_quantity(n, p.unit)} = {_value(p)}" for n, p in c.parameters.items())
        remark = f"Cannot be added to this simulator: {html.escape(c.acts)}." if c.acts else ""
        if not remark and set(c.fitted_with) != set(report.verdict.effects) - {c.effect}:
            remark = f"Judged together with {html.escape(listed(c.fitted_with))}."
        named = c.effect in report.verdict.effects
        cells = (
            f"<b>{_name(c.effect)}</b>{' ◆' if named else ''}<br><span class='small'>{_about(c.effect)}</span>"
            + (f"<br><i class='small'>{remark}</i>" if remark else ""),
            f"{100 * c.probability:.0f} %",
            "–" if c.acts or nothing else html.escape(_percent(c.closure, c.closure_ci)),
            "–" if c.acts or nothing else f"{c.gap_before:.3g} → {c.gap_after:.3g}",
            parameters or "–",
        )
        rows.append((named, cells))
    head = (
        "effect",
        "probability",
        "closes (90 % interval)",
        "gap before → after",
        "fitted parameters (90 % interval)",
    )
    first = [cells for i, (named, cells) in enumerate(rows) if named or i < 6]
    others = [cells for i, (named, cells) in enumerate(rows) if not named and i >= 6]
    folded = _folded(f"{len(others)} more candidates", _table(head, others) if others else "")
    return _section(
        "Which effect is missing",
        "Every effect of the catalogue that the twin does not have yet: probability that the machine has it, and the "
        "part of the gap that it closes on records not used to fit it, beside the verdict's other effects."
        + (" ◆ marks the verdict." if report.verdict.effects else ""),
        figures.get("closures", "") + _table(head, first) + folded,
    )


def _confidence(report: GapReport) -> str:
    sets = report.verdict.confidence_set
    if not sets:
        return ""
    words = [listed(effects) if effects else "no missing effect at all" for effects in sets]
    if len(sets) == 1:
        text = f"One explanation is left: {html.escape(words[0])}. Every other one is ruled out at 90 %."
        return _section("What the data cannot tell apart", text)
    sure = [name for name in sets[0] if all(name in s for s in sets)]
    text = f"{count_words(len(sets)).capitalize()} explanations cannot be ruled out, most probable first; "
    text += "the true one is among them nine times of ten, effects too faint for records like these not counted. "
    if sure:
        text += f"All of them hold {listed(sure)}. "
    if open_ones := undecided(report):
        few, others = open_ones[:_MOST_EXPLANATIONS], len(open_ones) - _MOST_EXPLANATIONS
        text += f"Left open: {listed([*few, f'{others} others'] if others > 0 else few, 'or')}."
    items = [f"<li>{html.escape(w)}</li>" for w in words]
    shown, more = items[:_MOST_EXPLANATIONS], items[_MOST_EXPLANATIONS:]
    listing = f"<ol>{''.join(shown)}</ol>"
    rest = f"<ol start='{len(shown) + 1}'>{''.join(more)}</ol>" if more else ""
    listing += _folded(f"{len(more)} less probable ones", rest)
    return _section("What the data cannot tell apart", html.escape(text), listing)


def _shrink(report: GapReport, figures: Mapping[str, str]) -> str:
    if not report.metrics:
        return ""
    effects = listed(report.verdict.effects)
    text = f"Before and after adding {effects}, on held-out records. The floor is records against records."
    if not report.verdict.effects:
        text = "On held-out records; nothing was added. The floor is records against records."
    shown = figures.get("metrics", "") + _metrics(report.metrics)
    return _section("How far the gap shrinks", html.escape(text), shown)


def _stand_ins(report: GapReport) -> str:
    found = report.stand_ins
    if found is None:
        return ""
    names = dict.fromkeys((*report.verdict.effects, *found.effects))
    rows = [
        (
            f"<b>{_name(name)}</b>{' ◆' if name in report.verdict.effects else ''}",
            "<br>".join(f"{_quantity(n, p.unit)} = {_value(p)}" for n, p in found.parameters[name].items()),
        )
        for name in names
        if name in found.parameters
    ]
    text = (
        f"{found.sentence} Real machines differ from a twin in much that has no name here; these effects, at these "
        "values, bring the twin closest to the records. Whether a model learns more from it, the accuracy says where "
        "faults are known. Before and after, on held-out records."
        + (" ◆ marks the verdict." if report.verdict.effects else "")
    )
    head = ("effect", "values, fitted together")
    return _section("The closest twin", html.escape(text), _metrics(found.metrics) + _table(head, rows))


def _metrics(metrics: Sequence[Metric]) -> str:
    head = ("measure", "before", "after (90 % interval)", "floor", "gap closed")
    rows = [
        (
            _name(m.metric)
            + (
                ""
                if not m.higher_is_better or "higher" in m.metric
                else " <span class='small'>(higher is better)</span>"
            ),
            _number(m.before, m.unit),
            html.escape(f"{_number(m.after, m.unit)} ({m.ci_after[0]:.3g} to {m.ci_after[1]:.3g})"),
            _number(m.floor, m.unit),
            "–" if m.closure is None else f"{100 * m.closure:.0f} %",
        )
        for m in metrics
    ]
    return _table(head, rows)


def _rest(report: GapReport) -> str:
    if not report.rest:
        return ""
    return _section(
        "Where the rest lies", "What remains significant after the effects are added.", _places(report.rest)
    )


def _next(report: GapReport) -> str:
    items = "".join(f"<li>{_code(html.escape(step))}</li>" for step in next_steps(report))
    lines = snippet(report)
    shown = f'<p class="small">TWIN.toml</p><pre>{html.escape(lines)}</pre>' if lines else ""
    return _section("What to do next", "", f'<ol class="steps">{items}</ol>{shown}', mark="next")


def _calibration(report: GapReport) -> str:
    if not report.calibration:
        return ""
    rows = [(_quantity(name, p.unit), _value(p)) for name, p in report.calibration.items()]
    return _section(
        "Calibration",
        "The twin's free parameters as identified from the other part of the records, before anything was compared. "
        "A gap that calibration removes is no gap.",
        _table(("parameter", "value (90 % interval)"), rows),
    )


def _notes(report: GapReport) -> str:
    items = "".join(f"<li>{html.escape(note)}</li>" for note in report.notes)
    return _section("Notes", "", f"<ul>{items}</ul>") if items else ""


def _provenance(report: GapReport) -> str:
    rows = [
        (_name(name), html.escape(_plain(value)))
        for name, value in report.provenance.items()
        if name != "runtime_s" and value != ""
    ]
    return _section("Provenance", "", _table(("", ""), rows, kind="quiet"))


def _places(places: Sequence[Place]) -> str:
    rows = [
        (
            str(i),
            _DOMAINS[p.domain],
            html.escape(place_words(Place(p.domain, p.lo, p.hi, p.unit, p.share, p.p_value))
                        if p.domain != "condition" or p.lo is not None or p.hi is not None else "–"),
            html.escape(condition_words(p.condition) or "all"),
            f"{100 * p.share:.0f} %",
            _p(p.p_value),
        )
        for i, p in enumerate(places, 1)
    ]  # fmt: skip
    head = ("#", "domain", "place", "conditions", "share", "p (adjusted)")
    more = rows[_MOST_PLACES:]
    return _table(head, rows[:_MOST_PLACES]) + _folded(f"{len(more)} more places", _table(head, more) if more else "")


def _section(title: str, text: str, content: str = "", mark: str = "") -> str:
    intro = f"<p>{text}</p>" if text else ""
    kind = f' class="{mark}"' if mark else ""
    return f'<section id="{_anchor(title)}"{kind}><h2>{title}</h2>{intro}{content}</section>'


def _folded(summary: str, content: str) -> str:
    """What unfolds when it is asked for; nothing where there is no more."""
    return f"<details><summary>{summary}</summary>{content}</details>" if content else ""


def _contents(sections: Iterable[str]) -> str:
    """Links to the sections that are there."""
    titles = [text.partition("<h2>")[2].partition("</h2>")[0] for text in sections if "<h2>" in text]
    return "<nav>" + "".join(f'<a href="#{_anchor(t)}">{t}</a>' for t in titles) + "</nav>"


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> str:
    """A table of cells that are HTML already."""
    top = "" if not any(head) else "<thead><tr>" + "".join(f"<th>{h}</th>" for h in head) + "</tr></thead>"
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table class="{kind}">{top}<tbody>{body}</tbody></table></div>'


def _records(report: GapReport) -> str:
    return str(report.provenance.get("records") or "records")


def _about(effect: str) -> str:
    """The first line that the effect's author wrote about it."""
    known = catalogue().get(effect)
    words = ((known.__doc__ or "") if known is not None else "").strip().splitlines()
    return _code(html.escape(words[0].replace("`", ""))) if words else ""


def _name(name: str) -> str:
    return html.escape(name.replace("_", " "))


def _quantity(name: str, unit: str) -> str:
    """A parameter's name without the unit at its end, which stands beside the value."""
    for said, suffix in _SUFFIXES.items():
        if unit == said:
            name = name.removesuffix(suffix)
    return _name(name)


def _value(parameter: ParameterValue) -> str:
    """A number with unit and interval, as HTML."""
    text = _number(parameter.value, parameter.unit)
    if parameter.ci is not None:
        text += f" ({_number(parameter.ci[0])} to {_number(parameter.ci[1])})"
    return html.escape(text)


def _number(value: float, unit: str = "") -> str:
    shown = f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"
    return (shown if unit in ("", "1") else f"{shown}\u00a0{unit}").replace("-", "−", int(value < 0))


def _percent(part: float, interval: tuple[float, float] | None) -> str:
    """A part with its interval in per cent, breaking before the interval only; rounded, so that nothing reads "-0"."""
    value, *ends = (round(100 * v) for v in (part, *(interval or ())))
    shown = f"{value} %" + (f" ({ends[0]} to {ends[1]} %)" if ends else "")
    return shown.replace("-", "−").replace(" ", "\u00a0").replace("\u00a0(", " (")


def _p(value: float) -> str:
    return f"{value:.2g}" if value >= 0.001 else "< 0.001"


def _plain(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_plain(v)}" for k, v in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_plain, value)) or "none"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _code(escaped: str) -> str:
    """`words` between backticks as code, in text that is escaped already."""
    parts = escaped.split("`")
    return "".join(f"<code>{p}</code>" if i % 2 else p for i, p in enumerate(parts)) if len(parts) % 2 else escaped


_SUFFIXES: Final[Mapping[str, str]] = {"Hz": "_hz", "rpm": "_rpm", "s": "_s", "N": "_n", "deg": "_deg", "1/s": "_per_s"}

_STYLE: Final = """
:root { --ink: #1d2330; --soft: #566072; --line: #dde1e8; --paper: #ffffff; --ground: #f4f5f8; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink); line-height: 1.55;
  font: 17px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 28px 20px 60px; }
header, section { background: var(--paper); border: 1px solid var(--line); border-radius: 12px; padding: 26px 32px;
  margin: 0 0 22px; }
header { border-left: 12px solid; padding-top: 22px; }
.status { margin: 0; font-weight: 700; font-size: 18px; letter-spacing: .02em; display: flex; align-items: center; }
.status span { width: 18px; height: 18px; border-radius: 50%; margin-right: 10px; }
h1 { font-size: 29px; line-height: 1.28; margin: 10px 0 14px; font-weight: 650; text-wrap: pretty; }
h2 { font-size: 23px; margin: 0 0 6px; }
h3 { font-size: 17px; margin: 18px 0 0; color: var(--soft); font-weight: 600; }
p { margin: 6px 0 12px; } .small { color: var(--soft); font-size: 15px; }
p.careful { border: 2px solid #D55E00; border-radius: 8px; padding: 10px 14px; }
header ul { margin: 0; padding-left: 22px; }
dl { display: flex; flex-wrap: wrap; gap: 12px 44px; margin: 14px 0 10px; }
dt { color: var(--soft); font-size: 15px; } dd { margin: 0; font-size: 21px; font-weight: 600; }
.js-plotly-plot .modebar { opacity: 0; } .js-plotly-plot:hover .modebar { opacity: 1; }
figure { margin: 4px 0 10px; width: 100%; }
nav { display: flex; flex-wrap: wrap; gap: 4px 22px; margin: 0 6px 20px; font-size: 15px; }
nav a { color: #0072B2; text-decoration: none; } nav a:hover { text-decoration: underline; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 16px; font-variant-numeric: tabular-nums; margin: 8px 0; }
th { text-align: left; font-size: 14.5px; color: var(--soft); font-weight: 600; border-bottom: 2px solid var(--line);
  padding: 6px 14px 6px 0; vertical-align: bottom; }
td { border-bottom: 1px solid var(--line); padding: 8px 14px 8px 0; vertical-align: top; overflow-wrap: anywhere; }
table.quiet td:first-child { color: var(--soft); width: 220px; }
details summary { cursor: pointer; color: #0072B2; padding: 8px 0; }
pre { background: #f0f3f8; border: 1px solid var(--line); border-radius: 8px; padding: 16px 20px; overflow-x: auto;
  font-size: 15.5px; line-height: 1.45; user-select: all; margin: 4px 0; }
code { background: #f0f3f8; border-radius: 4px; padding: 1px 5px; font-size: 15px; }
section.next { border-left: 12px solid #566072; } ol.steps li { margin: 0 0 10px; }
@media print { nav { display: none; } body { background: #fff; }
  /* Figures keep the width that they have on the screen: the page is shrunk as a whole to fit the paper. */
  main { width: 1080px; max-width: none; zoom: .66; padding: 0; font-size: 19px; }
  header, section { border-radius: 0; border-width: 1px 0 0; padding: 14px 0; }
  header { border-left-width: 8px; padding-left: 14px; }
  figure, tr, pre { break-inside: avoid; } h2, h3 { break-after: avoid; } .modebar { display: none !important; } }
"""
