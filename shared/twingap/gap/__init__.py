"""The gap between simulated and real records: where it lies, which effect causes it, how far it shrinks.

records + twin --calibrate--> --measure--> --where--> --which--> --how far--> GapReport
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from twingap.gap.api import diagnose
    from twingap.gap.diagnosis import Diagnosis
    from twingap.gap.report.files import read_report
    from twingap.gap.report.model import GapReport


def __getattr__(name: str) -> Any:
    """Public names, imported when they are asked for: a report is read without what diagnoses."""
    if name == "diagnose":
        from twingap.gap.api import diagnose

        return diagnose
    if name == "Diagnosis":
        from twingap.gap.diagnosis import Diagnosis

        return Diagnosis
    if name == "GapReport":
        from twingap.gap.report.model import GapReport

        return GapReport
    if name == "read_report":
        from twingap.gap.report.files import read_report

        return read_report
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["Diagnosis", "GapReport", "diagnose", "read_report"]
