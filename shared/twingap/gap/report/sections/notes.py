"""Section "Notes": remarks on what could not be decided, and on replacements."""

from __future__ import annotations

from collections.abc import Mapping

from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Items, Section


def section(report: GapReport, figures: Mapping[str, str]) -> Section | None:
    """The notes as a list."""
    return Section("Notes", parts=(Items(report.notes),)) if report.notes else None
