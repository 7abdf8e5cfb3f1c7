"""Seeds taken together are counted as the worlds that they are, and only where one diagnosis saw them all."""

import json
import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import study_standins as standins
from test_runner import CASES, small_study

from twingap.errors import TwingapError
from twingap.study import alone, pooled, scores, write_study
from twingap.study.alone import slowest_again
from twingap.study.pooled import markdown, read_studies, rows_of


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, list[Path]]:
    """A study, its folder, and a folder with the same worlds as those of another seed."""
    out = tmp_path_factory.mktemp("studies")
    folders = [out / "three", out / "four"]
    study = small_study(folders[0], training_count=12)
    write_study(study, folders[0])
    table = json.loads((folders[0] / "study.json").read_text(encoding="utf-8"))
    table["provenance"]["seed"] = 4
    folders[1].mkdir()
    (folders[1] / "study.json").write_text(json.dumps(table), encoding="utf-8")
    return study, folders


def test_rows_come_back_as_they_were_scored(seeds: tuple[Any, list[Path]]) -> None:
    study, folders = seeds
    (table,) = read_studies(folders[:1])
    back = rows_of(table)
    assert list(back) == list(study.rows)
    for method, rows in study.rows.items():
        # Compared by their words: NaN is no number that equals itself.
        assert list(map(repr, scores.headline(back[method]))) == list(map(repr, scores.headline(rows)))


def test_counts_add_up(seeds: tuple[Any, list[Path]]) -> None:
    study, folders = seeds
    together = scores.headline([row for table in read_studies(folders) for row in rows_of(table)["diagnosis"]])
    for score, each in zip(together, scores.headline(study.rows["diagnosis"]), strict=True):
        assert score.n == 2 * each.n
        if each.k is not None:
            assert score.k == 2 * each.k
    page = markdown(read_studies(folders))
    assert page.startswith("6 worlds, seed 3, seed 4;")
    (line,) = [line for line in page.splitlines() if line.startswith("| first-named right | single, medium or strong")]
    assert "| 1 of 1: 1 (0.025 to 1) | 1 of 1: 1 (0.025 to 1) | 2 of 2: 1 (0.158 to 1) | at least 0.95 | yes |" in line
    assert "extra-trees, one classifier" in page


def test_what_cannot_be_counted_together_is_named(seeds: tuple[Any, list[Path]], tmp_path: Path) -> None:
    _, folders = seeds
    with pytest.raises(TwingapError, match="seed 3 is in"):
        read_studies([folders[0], folders[0]])
    with pytest.raises(TwingapError, match="no finished study"):
        read_studies([folders[0], tmp_path])
    for part, text in (("learnt_sha256", "another"), ("code_sha256", {"diagnosis": "another"})):
        other = tmp_path / part
        shutil.copytree(folders[1], other)
        table = json.loads((other / "study.json").read_text(encoding="utf-8"))
        table["provenance"][part] = text
        (other / "study.json").write_text(json.dumps(table), encoding="utf-8")
        with pytest.raises(TwingapError, match="of another diagnosis"):
            read_studies([folders[0], other])


@pytest.mark.parametrize("module", [pooled, alone])
def test_without_a_study_a_program_ends_with_one_line(
    module: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [module.__name__, str(tmp_path)])
    assert module.main() == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith("error: ") and said.err.count("\n") == 1


def test_the_slowest_are_timed_again_alone(seeds: tuple[Any, list[Path]]) -> None:
    (table,) = read_studies(seeds[1][:1])
    timed = slowest_again(table, 2, CASES, standins.by_level)
    slowest = sorted(table["worlds"], key=lambda world: -world["found"]["runtime_s"])[:2]
    assert [t.case for t in timed] == [world["was"]["case"] for world in slowest]
    assert all(t.same and 0 < t.alone_s < 10 for t in timed)
    with pytest.raises(TwingapError, match="another diagnosis"):
        slowest_again(table, 1, CASES, lambda *_, **__: standins.answer("explained", ("gear_mesh",)))
    with pytest.raises(TwingapError, match="another diagnosis"):
        slowest_again(
            {**table, "provenance": {**table["provenance"], "learnt_sha256": "0"}}, 1, CASES, standins.by_level
        )
