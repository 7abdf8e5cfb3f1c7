"""The live twin: states and now and then vibration come in, parameters are kept up to date, updates recorded.

StateMessage, Snapshot --> Reorder --> LiveTwin (Laws, SpectrumModel, DriftDetector, refit) --> Journal

Used in: Paper 2, section 2 (figure 7), a bearing digital twin that is updated by simple state signals.
"""

from twingap.twins.live.drift import Alarm, DriftDetector, false_alarms, run_length, threshold_for
from twingap.twins.live.journal import Journal, Judgement, Update
from twingap.twins.live.laws import ClearanceLaw, DampingLaw, Laws
from twingap.twins.live.messages import Message, Snapshot, StateMessage
from twingap.twins.live.order import OrderOptions, Reorder
from twingap.twins.live.refit import Fit, deviation, refit, relative_error
from twingap.twins.live.spectrum import Band, MachineState, SpectrumModel
from twingap.twins.live.twin import LiveOptions, LiveTwin

__all__ = [
    "Alarm",
    "Band",
    "ClearanceLaw",
    "DampingLaw",
    "DriftDetector",
    "Fit",
    "Journal",
    "Judgement",
    "Laws",
    "LiveOptions",
    "LiveTwin",
    "MachineState",
    "Message",
    "OrderOptions",
    "Reorder",
    "Snapshot",
    "SpectrumModel",
    "StateMessage",
    "Update",
    "deviation",
    "false_alarms",
    "refit",
    "relative_error",
    "run_length",
    "threshold_for",
]
