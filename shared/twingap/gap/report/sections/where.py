"""Section "Where the gap lies": significant places, largest share first."""

from __future__ import annotations

from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Figures, Section, figure
from twingap.gap.report.sections.places import places_table


def section(report: GapReport, figures: Figures) -> Section | None:
    """The places of the gap as a figure and a table."""
    if not report.places:
        return Section("Where the gap lies", "No place differs significantly (family-wise error 5 %).")
    text = "Significant places only (family-wise error 5 %), largest share of the gap first."
    return Section("Where the gap lies", text, (*figure(figures, "shares"), places_table(report.places)))
