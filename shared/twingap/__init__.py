"""twingap: simulated bearing vibration, and what it lacks."""

from twingap.bearing import BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet

__version__ = "0.1.0"

__all__ = ["BEARINGS", "Bearing", "Condition", "Record", "RecordSet", "TwingapError", "__version__"]
