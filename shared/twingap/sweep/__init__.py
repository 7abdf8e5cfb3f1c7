"""Sweeps: many independent jobs on one machine or a cluster, results keyed by content."""

from twingap.sweep.backends import BACKENDS
from twingap.sweep.jobs import Result, SweepError, sweep

__all__ = ["BACKENDS", "Result", "SweepError", "sweep"]
