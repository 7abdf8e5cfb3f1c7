"""Section "Calibration": the identified parameters of the twin."""

from __future__ import annotations

from twingap.gap.report.formats import quantity, value
from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Figures, Section, Table


def section(report: GapReport, figures: Figures) -> Section | None:
    """The twin's identified parameters as a table."""
    if not report.calibration:
        return None
    rows = [(quantity(name, p.unit), value(p)) for name, p in report.calibration.items()]
    text = "The twin's free parameters as identified from the other part of the records, before anything was compared. "
    text += "A difference that calibration removes is not part of the gap."
    return Section("Calibration", text, (Table(("parameter", "value (90 % interval)"), rows),))
