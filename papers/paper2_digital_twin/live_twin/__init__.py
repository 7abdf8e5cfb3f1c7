"""Live twin: parameters kept up to date from states and occasional vibration, with a journal of updates.

StateMessage, Snapshot --> Reorder --> LiveTwin (Laws, SpectrumModel, DriftDetector, refit) --> Journal

Used in: Paper 2, section 2 (figure 7), a bearing digital twin that is updated by simple state signals.
"""
