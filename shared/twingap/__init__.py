"""twingap: what a simulation of bearing vibration lacks, measured on real records.

The verbs take records (a set or its folder) and a twin (a specification or its file), and are imported when they are
first used::

    import twingap

    found = twingap.diagnose("my-records", "twin.toml", seed=0)
    found.report.sentence
    found.write("out")
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from twingap.bearing import BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet

if TYPE_CHECKING:
    from twingap.adapt.classify import classify
    from twingap.gap.api import diagnose
    from twingap.gap.closing import close
    from twingap.identification.identify import identify
    from twingap.records.folder import read_record_set as read_records
    from twingap.twins.simulate import simulate
    from twingap.twins.twin_file import read_twin

__version__ = "0.1.0"

_VERBS: Final = {
    "classify": ("twingap.adapt.classify", "classify"),
    "close": ("twingap.gap.closing", "close"),
    "diagnose": ("twingap.gap.api", "diagnose"),
    "identify": ("twingap.identification.identify", "identify"),
    "read_records": ("twingap.records.folder", "read_record_set"),
    "read_twin": ("twingap.twins.twin_file", "read_twin"),
    "simulate": ("twingap.twins.simulate", "simulate"),
}


def __getattr__(name: str) -> Any:
    if name not in _VERBS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, function = _VERBS[name]
    return getattr(import_module(module), function)


__all__ = [
    "BEARINGS",
    "Bearing",
    "Condition",
    "Record",
    "RecordSet",
    "TwingapError",
    "__version__",
    "classify",
    "close",
    "diagnose",
    "identify",
    "read_records",
    "read_twin",
    "simulate",
]
