"""Runs that studies keep lie beside the test, not in the folder that it was started in."""

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def own_home(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A TWINGAP_HOME of the test's own."""
    home = tmp_path_factory.mktemp("home")
    monkeypatch.setenv("TWINGAP_HOME", str(home))
    return home
