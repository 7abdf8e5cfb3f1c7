"""Section "Provenance": records, twin and software of the diagnosis."""

from __future__ import annotations

from twingap.gap.report.formats import name, plain
from twingap.gap.report.model import GapReport
from twingap.gap.report.sections.parts import Figures, Section, Table


def section(report: GapReport, figures: Figures) -> Section | None:
    """The provenance as a table, without the run time: equal runs give equal pages."""
    rows = [(name(key), plain(v)) for key, v in report.provenance.items() if key != "runtime_s" and v != ""]
    return Section("Provenance", parts=(Table((), rows, kind="quiet"),))
