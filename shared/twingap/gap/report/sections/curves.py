"""Section "Before and after": spectra and other curves of records and twin."""

from __future__ import annotations

from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Figure, Figures, Section


def section(report: GapReport, figures: Figures) -> Section | None:
    """A figure for each curve of the report."""
    names = [name for name in figures if name.startswith("curve-")]
    if not names:
        return None
    return Section(
        "Before and after",
        "Medians over held-out records. Yellow bands are the places where the gap is significant, numbered as in the "
        "table below. Drag to zoom, double-click to zoom out.",
        [
            Figure(figures[name], report.curves[name.removeprefix("curve-")].title, wide=name == "curve-spectrum")
            for name in names
        ],
    )
