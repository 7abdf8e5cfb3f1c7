"""Section "Notes": remarks on what could not be decided, and on replacements."""

from __future__ import annotations

from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Figures, Items, Section


def section(report: GapReport, figures: Figures) -> Section | None:
    """The notes as a list."""
    return Section("Notes", parts=(Items(report.notes),)) if report.notes else None
