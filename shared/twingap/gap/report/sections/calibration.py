"""Section "Calibration": the identified parameters of the twin."""

from __future__ import annotations

from twingap.gap.report.formats import quantity, value
from twingap.gap.report.model import REFERENCE, GapReport
from twingap.gap.report.sections.parts import Figures, Section, Table


def section(report: GapReport, figures: Figures) -> Section | None:
    """The twin's identified parameters as a table, those with the named effects beside them where they differ."""
    if not report.calibration:
        return None
    text = "The twin's free parameters as identified from the other part of the records, before anything was compared. "
    text += "A difference that calibration removes is not part of the gap."
    after = report.calibration_after
    rows = [
        (quantity(name, p.unit), value(p), value(after[name]) if name in after else "")
        for name, p in report.calibration.items()
        if name != REFERENCE
    ]
    if (unit := report.calibration.get(REFERENCE)) is not None:  # of the twin with the effects
        shown = value(unit)
        rows.append((quantity(REFERENCE, unit.unit), *(("", shown) if after else (shown, ""))))
    if after:
        text += " The named effects change some of them: the twin was calibrated again with these."
    head = ("parameter", "value (90 % interval)", "with the named effects")[: 3 if after else 2]
    return Section("Calibration", text, (Table(head, [row[: len(head)] for row in rows]),))
