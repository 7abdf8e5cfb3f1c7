"""Record sets are found below a folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from twingap.errors import TwingapError
from twingap.fleet.record_sets import find_record_sets


def test_all_are_found_but_results_and_hidden_ones(tmp_path: Path) -> None:
    top = tmp_path / "Werk 1"
    for path in ("b/Prüfstand 7", "b", "a", ".hidden/a", "out/a", "a/inner/deep", "nothing"):
        (top / path).mkdir(parents=True, exist_ok=True)
        if path != "nothing":
            (top / path / "recordset.toml").touch()
    (top / "without description").mkdir()
    (top / "without description" / "records.csv").touch()
    expected = ["a", "a/inner/deep", "b", "b/Prüfstand 7", "without description"]
    assert find_record_sets(top, top / "out") == expected
    (top / "recordset.toml").touch()
    assert find_record_sets(top, top / "out") == [".", *expected]


def test_links_are_followed_but_not_in_a_circle(tmp_path: Path) -> None:
    top, other = tmp_path / "top", tmp_path / "elsewhere"
    other.mkdir()
    (other / "recordset.toml").touch()
    (top / "a").mkdir(parents=True)
    (top / "a" / "set").symlink_to(other)
    (top / "a" / "back").symlink_to(top)
    assert find_record_sets(top, tmp_path / "out") == ["a/set"]


def test_a_folder_without_any_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="holds no record set"):
        find_record_sets(tmp_path, tmp_path / "out")
    with pytest.raises(TwingapError, match="no such folder"):
        find_record_sets(tmp_path / "none", tmp_path / "out")
    with pytest.raises(TwingapError, match="is the folder of the records"):
        find_record_sets(tmp_path, tmp_path / "." / "x" / "..")
