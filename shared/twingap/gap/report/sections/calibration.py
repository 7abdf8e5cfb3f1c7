"""Section "Calibration": the identified parameters of the twin."""

from __future__ import annotations

from collections.abc import Mapping

from twingap.gap.report.formats import quantity, value
from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Section, Table


def section(report: GapReport, figures: Mapping[str, str]) -> Section | None:
    """The twin's identified parameters as a table."""
    if not report.calibration:
        return None
    return Section(
        "Calibration",
        "The twin's free parameters as identified from the other part of the records, before anything was compared. "
        "A difference that calibration removes is not part of the gap.",
        (
            Table(
                ("parameter", "value (90 % interval)"),
                [(quantity(name, p.unit), value(p)) for name, p in report.calibration.items()],
            ),
        ),
    )
