"""Live twin: parameters kept up to date from states and occasional vibration, with a journal of updates.

StateMessage, Snapshot --> Reorder --> LiveTwin (Laws, SpectrumModel, DriftDetector, refit) --> Journal

Used in: Paper 2, section 2 (figure 7), a bearing digital twin that is updated by simple state signals.
"""

from papers.paper2_digital_twin.live_twin.drift import Alarm, DriftDetector, false_alarms, run_length, threshold_for
from papers.paper2_digital_twin.live_twin.journal import Evaluation, Journal, Update
from papers.paper2_digital_twin.live_twin.laws import ClearanceLaw, DampingLaw, Laws
from papers.paper2_digital_twin.live_twin.messages import Message, OrderOptions, Reorder, Snapshot, StateMessage
from papers.paper2_digital_twin.live_twin.refit import Fit, deviation, refit, relative_error
from papers.paper2_digital_twin.live_twin.spectrum import Band, MachineState, SpectrumModel
from papers.paper2_digital_twin.live_twin.twin import LiveOptions, LiveTwin

__all__ = [
    "Alarm", "Band", "ClearanceLaw", "DampingLaw", "DriftDetector", "Evaluation", "Fit", "Journal", "Laws",
    "LiveOptions", "LiveTwin", "MachineState", "Message", "OrderOptions", "Reorder", "Snapshot", "SpectrumModel",
    "StateMessage", "Update", "deviation", "false_alarms", "refit", "relative_error", "run_length", "threshold_for",
]  # fmt: skip
