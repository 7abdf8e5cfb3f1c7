"""Section "What to do next": advice, the most useful first, and lines for the twin file."""

from __future__ import annotations

from twingap.gap.report.advice import next_steps, snippet
from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Code, Figures, Items, Section


def section(report: GapReport, figures: Figures) -> Section | None:
    """What to do next, and the verdict's effects as TWIN.toml takes them."""
    lines = snippet(report)
    code = (Code(lines, "TWIN.toml"),) if lines else ()
    steps = Items(next_steps(report), ordered=True, kind="steps")
    return Section("What to do next", parts=(steps, *code), kind="next")
