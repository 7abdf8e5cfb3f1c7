"""The gap between simulated and real records: where it lies, which effect causes it, how far it shrinks.

records + twin --calibrate--> --measure--> --where--> --which--> --how far--> GapReport
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from twingap.gap.diagnosis import Diagnosis, diagnose
    from twingap.gap.report import GapReport, read_report

_HOME = {
    "Diagnosis": "twingap.gap.diagnosis",
    "GapReport": "twingap.gap.report",
    "diagnose": "twingap.gap.diagnosis",
    "read_report": "twingap.gap.report",
}


def __getattr__(name: str) -> Any:
    """Public names, imported when they are asked for: a report is read without what diagnoses."""
    import importlib

    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["Diagnosis", "GapReport", "diagnose", "read_report"]
