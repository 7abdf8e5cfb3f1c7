"""The sections of report.html, in their order on the page: what to do, then the evidence.

A section is a module with ``section(report, figures) -> Section | None`` and is listed here; None leaves it out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from twingap.gap.report.sections.parts import Section

SECTIONS: Final[tuple[Callable[[GapReport, Mapping[str, str]], Section | None], ...]] = tuple(
    module.section
    for module in (
        next_steps, curves, where, which, confidence, shrink, rest, closest, calibration, notes, provenance,
    )
)  # fmt: skip
