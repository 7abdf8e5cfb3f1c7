"""The gap between simulated and real records: where it lies, which effect causes it, how far it shrinks.

records + twin --calibrate--> --measure--> --where--> --which--> --how far--> GapReport

`api` is the whole road on one page. `features` holds the named numbers that detectors read, `distance` the domains in
which a gap is measured, `search` the search for missing effects and their values, `knowledge` what was learnt from
simulated machines and its training, `report` the result as objects, files and a page. `features.registry`,
`distance.domains`, `distance.closure_metrics` and `report.sections` say how to add a feature, a domain, a measure of
the gap, and a section; an effect is a file in `twingap.effects`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from twingap.gap.api import diagnose
    from twingap.gap.diagnosis import Diagnosis
    from twingap.gap.report.files import read_report
    from twingap.gap.report.model import GapReport

_MODULES: Final = {
    "diagnose": "api", "Diagnosis": "diagnosis", "GapReport": "report.model", "read_report": "report.files",
}  # fmt: skip
"""Public names and their modules, imported on first use, so that a report is read without the diagnosis."""


def __getattr__(name: str) -> Any:
    """A public name, from its module."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"twingap.gap.{_MODULES[name]}"), name)


__all__ = ["Diagnosis", "GapReport", "diagnose", "read_report"]
