"""`twingap gap` as it is typed_gap."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.bearing import BEARINGS
from twingap.gap.report.files import from_json, read_report
from twingap.gap.report.schema import problems
from twingap.records import Condition, Record
from twingap.records.folder import read_record_set, write_records
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import read_twin


@pytest.fixture
def typed_gap(typed: Run) -> Run:
    """Runs `twingap gap ...`."""
    return partial(typed, "gap")


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Healthy and inner-race records of a twin, in a folder with a name that is not ASCII."""
    folder = tmp_path_factory.mktemp("sets") / "Prüfstand 7"
    conditions = [Condition(f"{f}{i}", 1797.0, 12000.0, 6000, f) for f in ("healthy", "inner") for i in range(4)]
    made = PhenomenologicalTwin(BEARINGS["6205"]).stream(conditions, np.random.default_rng(0))
    return write_records(folder, "made", "g", BEARINGS["6205"], None, made)


@pytest.fixture
def twin(tmp_path: Path) -> Path:
    path = tmp_path / "mein Zwilling.toml"
    path.write_text('[twin]\nmodel = "phenomenological"\n', encoding="utf-8")
    return path


@pytest.mark.parametrize("asked", ["--help", "-h"])
def test_help_explains_the_diagnosis(typed_gap: Run, asked: str) -> None:
    said = typed_gap(asked)
    assert said.status == 0
    for part in ("twingap gap [OPTIONS]", "RECORDSET", "--twin", "--out", "--sim", "--export", "--seed", "Examples:"):
        assert part in said.out


@pytest.mark.parametrize(
    ("words", "now"),
    [
        (("train", "--seed", "1"), "twingap train"),
        (("study", "--out", "o", "--cases", "9"), "twingap study blind"),
        (("public",), "twingap study public"),
    ],
)
def test_commands_that_moved_are_named(
    typed_gap: Run, words: tuple[str, ...], now: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(typed_gap(*words), f"`twingap gap {words[0]}` is now `{now}`")
    (tmp_path / words[0]).mkdir()  # a record set of that name is one
    refused(typed_gap(words[0]), "missing option", "--twin")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["there"], ("missing option", "--twin", "see `twingap gap --help`")),
        (["--twin", "t", "--out", "o"], ("missing argument", "RECORDSET", "see `twingap gap --help`")),
        (["there", "--frob"], ("no such option", "--frob", "see `twingap gap --help`")),
        (["./study"], ("missing option", "--twin")),
        (["there", "--twin", "t", "--out", "o", "--seed", "-1"], ("--seed", "0")),
        (["there", "--twin", "nowhere.toml", "--out", "o"], ("nowhere.toml",)),
    ],
)
def test_what_was_mistyped_is_told_in_one_line(
    typed_gap: Run, arguments: list[str], parts: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = typed_gap(*arguments)
    assert said.status == 2 and said.out == ""
    assert said.err.startswith("twingap: ") and said.err.count("\n") == 1
    for part in parts:
        assert part in said.err
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_read_or_written_is_told_before_any_work(
    typed_gap: Run, records: Path, twin: Path, tmp_path: Path
) -> None:
    taken = tmp_path / "out"
    (taken / "sim_after").mkdir(parents=True)
    (taken / "sim_after" / "mine").write_text("kept")
    before = sorted(tmp_path.rglob("*"))
    for arguments, part in (
        ((tmp_path / "none", "--twin", twin, "--out", tmp_path / "new"), "none"),
        ((records, "--twin", records, "--out", tmp_path / "new"), records.name),
        ((records, "--twin", twin, "--out", twin), twin.name),
        ((records, "--twin", twin, "--out", tmp_path / "new", "--sim", tmp_path / "nowhere"), "nowhere"),
        ((records, "--twin", twin, "--out", taken, "--export"), "sim_after"),
        ((records, "--twin", twin, "--out", "/proc/nothing"), "/proc/nothing"),
        ((records, "--twin", twin, "--out", tmp_path / "new", "--tracking-uri", "sqlite:////proc/no/x.db"), "/proc/no"),
    ):
        said = typed_gap(*arguments)
        assert said.status == 2 and said.out == ""
        assert said.err.startswith("twingap: ") and said.err.count("\n") == 1
        assert part in said.err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.usefixtures("few_trials")
def test_a_diagnosis_is_written_printed_exported_and_the_same_again(
    typed_gap: Run, records: Path, twin: Path, tmp_path: Path, new_database: Callable[[Path], str]
) -> None:
    store = tmp_path / "runs.db"
    out = tmp_path / "Ergebnis ü"
    said = typed_gap(
        records, "--twin", twin, "--out", out, "--export", "--json", "--seed", 3, "--tracking-uri", new_database(store)
    )
    assert said.status == 0, said.err
    names = ("gap.json", "report.html", "closest.toml", "sim_before", "sim_after", "sim_closest")
    wanted = [out / name for name in names]
    assert said.err.splitlines()[-6:] == [str(path) for path in wanted]
    assert sorted(p.name for p in out.iterdir()) == sorted(p.name for p in wanted)
    printed: dict[str, Any] = json.loads(said.out)
    assert problems(printed) == []
    assert from_json(printed) == read_report(out)
    assert printed["provenance"]["seed"] == 3
    asked = read_record_set(records)
    assert printed["provenance"]["records_sha256"] == asked.digest
    for name in ("sim_before", "sim_after", "sim_closest"):
        made = read_record_set(out / name)
        conditions = {(c.name, c.fault, c.fs_hz, c.n_samples) for c in made.conditions}
        assert conditions == {(c.name, c.fault, c.fs_hz, c.n_samples) for c in asked.conditions}
        assert made.unit == asked.unit and made.bearing == asked.bearing
    with sqlite3.connect(store) as database:
        assert database.execute("SELECT count(*) FROM runs").fetchone() == (1,)
    again = typed_gap(records, "--twin", twin, "--out", tmp_path / "again", "--no-track", "--seed", 3)
    assert again.status == 0 and again.out.splitlines()[-1] == str(tmp_path / "again" / "closest.toml")
    repeated = json.loads((tmp_path / "again" / "gap.json").read_text(encoding="utf-8"))
    for table in (printed, repeated):
        del table["provenance"]["runtime_s"]
    assert repeated == printed
    page = (out / "report.html").read_bytes()
    assert page == (tmp_path / "again" / "report.html").read_bytes()
    assert printed["verdict"]["sentence"] in again.out


@pytest.mark.slow
@pytest.mark.usefixtures("few_trials")
def test_the_closest_twin_is_a_file_that_simulates(typed: Run, records: Path, twin: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    said = typed("gap", records, "--twin", twin, "--out", out, "--export", "--no-track")
    assert said.status == 0, said.err
    wanted = ["closest.toml", "gap.json", "report.html", "sim_after", "sim_before", "sim_closest"]
    assert sorted(p.name for p in out.iterdir()) == wanted
    assert str(out / "closest.toml") in said.out and str(out / "sim_closest") in said.out
    spec = read_twin(out / "closest.toml")
    report = read_report(out)
    assert set(spec.effects) == {one.effect for one in report.closest.effects} and report.closest.twin == "closest.toml"
    assert spec.identified is not None and spec.identified.records_sha256 == report.provenance["records_sha256"]
    made = typed("simulate", out / "closest.toml", "--records", records, "--out", tmp_path / "made")
    assert made.status == 0, made.err
    assert len(read_record_set(tmp_path / "made")) == len(read_record_set(records))


@pytest.mark.slow
def test_records_of_another_simulator_take_the_twins_place(
    typed_gap: Run, records: Path, twin: Path, tmp_path: Path
) -> None:
    conditions = read_record_set(records).conditions
    again = PhenomenologicalTwin(BEARINGS["6205"]).stream(conditions, np.random.default_rng(1))
    sim = write_records(tmp_path / "sim", "made", "g", BEARINGS["6205"], None, again)
    said = typed_gap(records, "--twin", twin, "--out", tmp_path / "out", "--sim", sim, "--no-track")
    assert said.status == 0, said.err
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["gap.json", "report.html"]  # it has no twin file
    report = read_report(tmp_path / "out")
    assert report.verdict.status == "no_gap"
    assert report.provenance["simulator"] == "made"


def test_what_cannot_be_diagnosed_is_refused_in_one_line(typed_gap: Run, twin: Path, tmp_path: Path) -> None:
    made = PhenomenologicalTwin(BEARINGS["6205"]).simulate(
        [Condition(f"r{i}", 1797.0, 12000.0, 6000, "healthy") for i in range(4)], np.random.default_rng(0)
    )
    still = [Record(r.condition, np.ones(6000)) for r in made]
    for name, kept, words in (
        ("one", made.take([0]), "at least 2 expected"),
        ("still", still, "all samples are equal"),
    ):
        folder = write_records(tmp_path / name, "made", "g", BEARINGS["6205"], None, kept)
        refused(typed_gap(folder, "--twin", twin, "--out", tmp_path / "out"), words)


def test_a_record_set_is_neither_its_own_simulator_nor_the_output(
    typed_gap: Run, records: Path, twin: Path, tmp_path: Path
) -> None:
    before = sorted(path.name for path in records.iterdir())
    asked = (records, "--twin", twin, "--no-track")
    refused(typed_gap(*asked, "--out", tmp_path / "out", "--sim", records), "simulated and real records are the same")
    refused(typed_gap(*asked, "--out", records), "is a record set", "name another folder")
    assert sorted(path.name for path in records.iterdir()) == before
