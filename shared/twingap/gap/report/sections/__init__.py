"""The sections of report.html, in their order on the page: what to do, then the evidence.

To add one, write a module with ``section(report, figures) -> Section | None``, where None leaves it out, and name it
below, in the import and in `SECTIONS`. `parts` has what a section consists of; a new figure is a function in
`report.figures`. What the section shows has to be in `GapReport` (`report.model`) and in gap_report.schema.json.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from twingap.gap.report.model import GapReport
from twingap.gap.report.sections import (
    calibration,
    closest,
    confidence,
    curves,
    next_steps,
    notes,
    provenance,
    rest,
    shrink,
    where,
    which,
)
from twingap.gap.report.sections.parts import Figures, Section

SECTIONS: Final[tuple[Callable[[GapReport, Figures], Section | None], ...]] = tuple(
    module.section
    for module in (
        next_steps, curves, where, which, confidence, shrink, rest, closest, calibration, notes, provenance,
    )
)  # fmt: skip
