"""`twingap demo`: a machine made, diagnosed and compared with the truth."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import pytest

from tests.twingap.cli.typed import Run, refused
from twingap import gap
from twingap.cli.demo import DRAWN_FROM
from twingap.effects import registry
from twingap.records.folder import read_record_set


def test_effects_to_draw_from_are_in_the_catalogue() -> None:
    assert set(DRAWN_FROM) <= set(registry.catalogue())


@pytest.mark.slow
def test_the_first_demonstration_names_what_is_hidden(
    typed: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the closest twin, which takes most of the time."""
    monkeypatch.setattr(gap, "diagnose", partial(gap.diagnose, quick=True))
    out = tmp_path / "demo"
    said = typed("demo", "--out", out)
    assert said.status == 0
    truth = json.loads((out / "truth.json").read_text())
    report = json.loads((out / "gap" / "gap.json").read_text())
    assert sorted(report["verdict"]["effects"]) == sorted(truth["effects"])
    assert len(read_record_set(out / "records")) == 16
    assert (out / "gap" / "report.html").is_file()
    for effect in truth["effects"]:
        assert re.search(rf"{effect}\s+│ named", said.out)
    assert f"twingap gap {out / 'records'} --twin {out / 'twin.toml'}" in said.out


def test_a_folder_with_content_is_not_overwritten(typed: Run, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    refused(typed("demo", "--out", tmp_path), "not an empty folder")
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]
