"""Section "The closest twin": what closes, by group of effects, and the values."""

from __future__ import annotations

from twingap.gap.report.formats import closure, name, p_value, parameters, percent
from twingap.gap.report.model import GapReport, GroupShare
from twingap.gap.report.sections.parts import Cell, Figures, Line, Part, Section, Table, figure
from twingap.gap.report.sections.shrink import metrics_table


def section(report: GapReport, figures: Figures) -> Section | None:
    """Shares of the groups, measures and values; None where nothing was attributed."""
    found = report.closest
    if not found.attribution:
        return None
    named = report.verdict.effects
    real = {
        "other real records of the same bearing": found.ceiling.same_unit,
        "real records of other bearings": found.ceiling.other_unit,
    }
    limits = [(words, closure(value)) for words, value in real.items() if value is not None]
    values = [
        ([Line(name(one.effect) + " ◆" * (one.effect in named), "strong")], parameters(one.parameters))
        for one in found.effects
    ]
    parts: list[Part] = [
        *figure(figures, "attribution"),
        Table(("group", "closes (90 % interval)", "p", "effects"), [_row(share) for share in found.attribution]),
        *([Table(("in place of the twin", "closes"), limits)] if limits else []),
        *([metrics_table(found.metrics)] if found.metrics else []),
        Table(("effect", "values, fitted together"), values, 4, "effects"),
    ]
    text = (
        f"{found.sentence} Real machines differ from a twin in ways that mimic each other; here all effects "
        "that bring the twin closer are fitted together, named or not, and measured on held-out records. What a group "
        "closes is its mean gain over the orders in which groups can be added, so that the shares add up."
    )
    if found.twin:
        text += f" The twin, with all values of its spectra, is in `{found.twin}`."
    else:
        text += " Your simulator has no twin file; `--export` writes its records with these effects, in `sim_closest`."
    return Section("The closest twin", text + (" ◆ marks the verdict." if named else ""), tuple(parts))


def _row(share: GroupShare) -> tuple[Cell, ...]:
    effects = tuple(f"{name(one.effect)} {percent(one.share)}" for one in share.effects)
    shown = (
        [Line(share.group, "strong")] if share.shown else [Line(share.group), Line("not shown to close any", "remark")]
    )
    return shown, percent(share.share, share.share_ci), p_value(share.p_value), effects
