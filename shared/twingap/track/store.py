"""Location of the tracking store in use, and of local runs."""

from __future__ import annotations

import os
from pathlib import Path


def state_folder() -> Path:
    """Folder of local runs: ``TWINGAP_HOME``, or ``.twingap`` in the current folder."""
    return Path(os.environ.get("TWINGAP_HOME") or ".twingap").absolute()


def tracking_uri(uri: str | None = None) -> str:
    """URI of the tracking store in use: `uri`, else ``MLFLOW_TRACKING_URI``, else SQLite in the state folder."""
    return uri or os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{state_folder() / 'mlflow.db'}"


def sqlite_path(uri: str) -> Path | None:
    """The database file of a ``sqlite:///`` address; None for any other."""
    return Path(uri.removeprefix("sqlite:///").split("?")[0]).absolute() if uri.startswith("sqlite:///") else None
