"""Section "Where the rest lies": places that stay significant with the effects added."""

from __future__ import annotations

from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Figures, Section
from twingap.gap.report.sections.places import places_table


def section(report: GapReport, figures: Figures) -> Section | None:
    """The places of the rest as a table."""
    if not report.rest:
        return None
    text = "What remains significant after the effects are added."
    return Section("Where the rest lies", text, (places_table(report.rest),))
