"""`twingap study blind`: errors in one line, before any work; its options."""

import json
import sys
from pathlib import Path

import pytest

from twingap.cli import main


def call(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr(sys, "argv", ["twingap", "study", "blind", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.mark.parametrize("text", ["{", "[]", json.dumps({"asked": {"seed": 1, "cases": "", "worlds": ""}})])
def test_a_folder_of_another_study_is_refused(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "sealed.json").write_text(text)
    assert call(monkeypatch, "--out", tmp_path, "--cases", 6) == 2
    message = capsys.readouterr().err.strip()
    assert "sealed" in message and "name a new folder" in message and "Traceback" not in message
    assert [p.name for p in tmp_path.iterdir()] == ["sealed.json"]


def test_too_few_worlds_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "--out", tmp_path / "new", "--cases", 5) == 2
    assert not (tmp_path / "new").exists()
    assert "--cases" in capsys.readouterr().err
