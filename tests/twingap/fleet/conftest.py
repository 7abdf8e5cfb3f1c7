"""A small fleet: three machines in nested folders, one of which has a plain gap, and a set that cannot be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.twingap.cli.conftest import typed  # noqa: F401
from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.records import Condition
from twingap.records.folder import write_record_set
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

COARSE, PLAIN, LAST, BAD = "Halle 1/Lüfter groß", "Halle 1/Pumpe 2", "z", "Halle 2/no table"
"""Paths of the machines; the first has a quantised signal."""


def write_machine(folder: Path, effects: tuple[Effect, ...], seed: int, count: int = 8) -> None:
    """Write records of 1 s of a simulated machine."""
    parameters = PhenomenologicalParameters(resonance_hz=1300.0, damping_ratio=0.04, scale=0.3)
    twin = PhenomenologicalTwin(BEARINGS["6205"], parameters, effects, unit="g")
    faults = ("healthy", "outer", "inner", "ball")
    conditions = [Condition(f"r{i}", (1500.0, 1800.0)[i // 4 % 2], 4096.0, 4096, faults[i % 4]) for i in range(count)]
    write_record_set(twin.simulate(conditions, np.random.default_rng(seed)), folder)


@pytest.fixture(scope="session")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("twin") / "mein Zwilling.toml"
    path.write_text('[twin]\nmodel = "phenomenological"\n', encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the fleet."""
    top = tmp_path_factory.mktemp("fleet") / "Maschinen & Co"
    write_machine(top / COARSE, (make_effect("quantisation", {"step": 0.8}),), 1)
    write_machine(top / PLAIN, (), 2)
    write_machine(top / LAST, (), 5)
    (top / BAD).mkdir(parents=True)
    (top / BAD / "recordset.toml").write_text('[recordset]\nunit = "g"\n', encoding="utf-8")
    return top
