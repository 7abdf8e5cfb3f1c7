"""Section "How far the gap shrinks": measures before and after the verdict's effects are added."""

from __future__ import annotations

from collections.abc import Sequence

from twingap.gap.report.formats import closure, name, number
from twingap.gap.report.model import GapReport, Metric, listed
from twingap.gap.report.sections.parts import Figures, Section, Table, figure


def section(report: GapReport, figures: Figures) -> Section | None:
    """Measures of the gap as a figure and a table."""
    if not report.metrics:
        return None
    text = f"Before and after adding {listed(report.verdict.effects)}, on held-out records."
    if not report.verdict.effects:
        text = "On held-out records; nothing was added."
    text += " The floor is records against records."
    if "metrics" in figures:
        text += " In the figure 100 % is the calibrated twin, 0 % the floor."
    return Section("How far the gap shrinks", text, (*figure(figures, "metrics"), metrics_table(report.metrics)))


def metrics_table(metrics: Sequence[Metric]) -> Table:
    """One row for each measure."""
    rows = [
        (
            name(m.metric) + " (higher is better)" * (m.higher_is_better and "higher" not in m.metric),
            number(m.before, m.unit),
            f"{number(m.after, m.unit)} ({m.ci_after[0]:.3g} to {m.ci_after[1]:.3g})",
            number(m.floor, m.unit),
            "–" if m.closure is None else closure(m.closure),
        )
        for m in metrics
    ]
    return Table(("measure", "before", "after (90 % interval)", "floor", "gap closed"), rows)
