"""Tracking: nested runs, stored in MLflow, in plain folders, or not at all."""

from twingap.track.folder import FolderTracker
from twingap.track.mlflow import MlflowTracker
from twingap.track.store import sqlite_path, state_folder, tracking_uri
from twingap.track.tracker import LONGEST_VALUE, NullTracker, Run, Status, Tracker

__all__ = [
    "LONGEST_VALUE",
    "FolderTracker",
    "MlflowTracker",
    "NullTracker",
    "Run",
    "Status",
    "Tracker",
    "sqlite_path",
    "state_folder",
    "tracking_uri",
]
