"""`twingap close` as it is typed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.records import Condition
from twingap.records.folder import write_records
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import read_twin


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight records of a machine with strong mains interference."""
    faults = ("healthy", "inner", "outer", "ball")
    conditions = [Condition(f"r{i}", 1500.0 + 20 * i, 8000.0, 4096, faults[i % 4]) for i in range(8)]
    effects = [make_effect("mains_interference", {"level": 1.0})]
    twin = PhenomenologicalTwin(BEARINGS["6205"], PhenomenologicalParameters(2000.0), effects)
    made = twin.stream(conditions, np.random.default_rng(0))
    return write_records(tmp_path_factory.mktemp("sets") / "machine", "made", "g", BEARINGS["6205"], None, made)


@pytest.fixture
def twin(tmp_path: Path) -> Path:
    path = tmp_path / "twin.toml"
    path.write_text('[twin]\nmodel = "phenomenological"\n', encoding="utf-8")
    return path


@pytest.mark.slow
def test_what_is_named_is_added_and_the_rest_is_reported(typed: Run, records: Path, twin: Path, tmp_path: Path) -> None:
    out = tmp_path / "closed.toml"
    said = typed("close", records, "--twin", twin, "--out", out, "--json")
    assert said.status == 0
    way = json.loads(said.out)
    assert way["steps"][0]["added"] == "mains_interference" and way["steps"][-1]["added"] == ""
    assert f"the gap falls from {way['steps'][0]['overall gap']:.3g} to " in way["sentence"]
    assert way["sentence"].count(" standard deviations; ") == 1
    gaps = [step["overall gap"] for step in way["steps"]]
    assert gaps == sorted(gaps, reverse=True) and way["closure"] > 0.8
    closed = read_twin(out)
    assert closed.effects == ("mains_interference",) and closed.parameters["resonance_hz"] == pytest.approx(
        2000, rel=0.05
    )
    rest = json.loads((tmp_path / "closed_gap" / "gap.json").read_text())
    assert rest["provenance"]["twin_effects"] == ["mains_interference"]


def test_the_twin_is_not_written_over(typed: Run, records: Path, twin: Path) -> None:
    before = twin.read_text()
    refused(typed("close", records, "--twin", twin, "--out", twin), "is read by this command")
    assert twin.read_text() == before
