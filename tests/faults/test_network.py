"""No command reaches another machine unless it is told to."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.conftest import FULL, Diagnosed, Forks
from tests.faults.test_kills import COMMANDS

QUIET = {
    "catalogue": ["effects"],
    "bearings": ["bearings"],
    "data sets": ["data", "list"],
    "version": ["--version"],
    "help": ["gap", "--help"],
}


def test_diagnosis_and_its_tracking_stay_here(diagnosed: Diagnosed) -> None:
    assert diagnosed.ended.network == []


@pytest.mark.parametrize("name", [*QUIET, "simulate", "import", *(("fleet", "study", "run") if FULL else ())])
def test_commands_stay_here(twingap: Forks, inputs: Path, tmp_path: Path, name: str) -> None:
    words, given = (QUIET[name], {}) if name in QUIET else (COMMANDS[name].words(inputs), COMMANDS[name].given)
    said = twingap(tmp_path, *words, **given, watch_network=True)
    assert said.status == 0, said.err
    assert said.network == []


def test_attempts_are_noticed(twingap: Forks, tmp_path: Path) -> None:
    said = twingap(tmp_path, "data", "fetch", "cwru", "--root", tmp_path / "data", watch_network=True, timeout_s=60)
    assert any("socket." in line for line in said.network)
    if twingap.isolated:
        assert said.refused()
