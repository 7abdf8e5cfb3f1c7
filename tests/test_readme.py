"""What the README shows runs as shown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from twingap.twins.twin_file import read_twin

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The first block of code in this language."""
    found = re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_python_example_shows_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {}
    exec(block("python"), names)
    line = float(capsys.readouterr().out)
    spectrum, bearing = names["spectrum"], names["bearing"]
    between = spectrum.at((bearing.bpfi + 0.4) * 1797 / 60)  # type: ignore[attr-defined]
    assert line > 5 * between


def test_the_twin_file_is_one(tmp_path: Path) -> None:
    (tmp_path / "twin.toml").write_text(block("toml"), encoding="utf-8")
    assert set(read_twin(tmp_path / "twin.toml").effects) == {"slip_jitter", "load_zone"}


def test_two_commands_stand_alone_and_are_what_is_checked_before_a_change_lands() -> None:
    commands = block("sh").strip().splitlines()
    assert len(commands) == 2 and [line.split()[-1] for line in commands] == ["demo,paper1", "tests"]
    assert all(line.startswith("python3 -m venv .venv && .venv/bin/pip install tox && ") for line in commands)
