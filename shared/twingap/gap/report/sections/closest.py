"""Section "The closest twin": surrogate effects beyond the verdict."""

from __future__ import annotations

from collections.abc import Mapping

from twingap.gap.report.formats import name, parameters
from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Line, Section, Table
from twingap.gap.report.sections.shrink import metrics_table


def section(report: GapReport, figures: Mapping[str, str]) -> Section | None:
    """The measures with surrogate effects, and the values of all effects; None without any."""
    found = report.stand_ins
    if found is None:
        return None
    named = report.verdict.effects
    rows = [
        ([Line(name(effect) + " ◆" * (effect in named), "strong")], parameters(found.parameters[effect]))
        for effect in dict.fromkeys((*named, *found.effects))
        if effect in found.parameters
    ]
    return Section(
        "The closest twin",
        f"{found.sentence} Real machines differ from a twin in ways that no effect of the catalogue describes; these "
        "effects, at these values, bring the twin closest to the records. Where faults are known, the accuracy shows "
        "whether a classifier learns more from it. Before and after, on held-out records."
        + (" ◆ marks the verdict." if named else ""),
        (metrics_table(found.metrics), Table(("effect", "values, fitted together"), rows)),
    )
