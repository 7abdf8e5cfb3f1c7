"""Runs that studies keep lie beside the test, not in the folder that it was started in; figures are not trimmed."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure


@pytest.fixture(scope="session", autouse=True)
def untrimmed_figures() -> Iterator[None]:
    """Figures are saved as large as they are: to trim them, each is drawn twice."""
    save = Figure.savefig

    def whole(self: Figure, *given: Any, **options: Any) -> None:
        save(self, *given, **{name: value for name, value in options.items() if name != "bbox_inches"})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", whole)
        yield


@pytest.fixture(autouse=True)
def own_home(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A TWINGAP_HOME of the test's own."""
    home = tmp_path_factory.mktemp("home")
    monkeypatch.setenv("TWINGAP_HOME", str(home))
    return home
