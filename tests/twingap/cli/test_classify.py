"""`twingap classify` as it is typed."""

from __future__ import annotations

import csv
import json
import os
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.bearing import BEARINGS
from twingap.records import Condition
from twingap.records.folder import write_records
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

COLUMNS = ["record", "predicted", "confidence", "healthy", "inner", "outer", "ball"]
QUICK = ("--machines", 4, "--no-match", "--method", "VMD+SVM")


@pytest.fixture
def twingap(typed: Run) -> Run:
    """Runs `twingap classify ...`."""
    return partial(typed, "classify")


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four records of known faults, in a folder with a name that is not ASCII."""
    faults = ("healthy", "inner", "outer", "ball")
    folder = tmp_path_factory.mktemp("sets") / "Prüfstand 7"
    conditions = [Condition(f"ä, {i}", 4800.0, 8000.0, 2048, fault) for i, fault in enumerate(faults)]
    twin = PhenomenologicalTwin(BEARINGS["6205"], PhenomenologicalParameters(2000.0))
    return write_records(folder, "made", "g", BEARINGS["6205"], None, twin.stream(conditions, np.random.default_rng(0)))


@pytest.fixture
def twin(tmp_path: Path) -> Path:
    path = tmp_path / "mein Zwilling.toml"
    path.write_text('[twin]\nmodel = "phenomenological"\n[parameters]\nresonance_hz = 2000.0\n', encoding="utf-8")
    return path


def test_a_row_a_record_and_what_confidence_means(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    """By the default method, matched to the records."""
    out = tmp_path / "neu" / "zwölf.csv"
    said = twingap(records, "--twin", twin, "--out", out, "--machines", 4, "--steps", 2)
    assert said.status == 0 and said.err == ""
    assert said.out.splitlines()[-1] == str(out)
    assert "machines like those simulated" in said.out and "`twingap gap`" in said.out
    assert [p.name for p in out.parent.iterdir()] == [out.name]
    with out.open(encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    assert header == COLUMNS
    assert [row[0] for row in rows] == ["ä, 0", "ä, 1", "ä, 2", "ä, 3"]
    for row in rows:
        by_class = dict(zip(COLUMNS[3:], map(float, row[3:]), strict=True))
        assert sum(by_class.values()) == pytest.approx(1, abs=1e-5)
        assert float(row[2]) == by_class[row[1]] == max(by_class.values())


def test_same_seed_same_bytes_whatever_the_fault_column_says(
    twingap: Run, twin: Path, records: Path, tmp_path: Path
) -> None:
    first = twingap(records, "--twin", twin, "--out", tmp_path / "a.csv", *QUICK, "--json")
    about = json.loads(first.out)
    assert about["classes"] == COLUMNS[3:] and len(about["records"]) == 4
    assert about["simulated"]["records"] == 16 and first.err.strip() == str(tmp_path / "a.csv")
    table = records / "records.csv"
    text = table.read_text(encoding="utf-8")
    try:
        swapped = text.replace("inner", "§").replace("ball", "inner").replace("§", "ball")
        assert swapped != text
        table.write_text(swapped, encoding="utf-8")
        assert twingap(records, "--twin", twin, "--out", tmp_path / "b.csv", *QUICK).status == 0
        table.write_text(text.replace("inner", "IR 0.007?"), encoding="utf-8")  # words of the user's own
        assert twingap(records, "--twin", twin, "--out", tmp_path / "d.csv", *QUICK).status == 0
    finally:
        table.write_text(text, encoding="utf-8")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "d.csv").read_bytes()
    assert twingap(records, "--twin", twin, "--out", tmp_path / "c.csv", *QUICK, "--seed", 1).status == 0
    assert (tmp_path / "a.csv").read_bytes() != (tmp_path / "c.csv").read_bytes()


def test_mistakes_are_one_line_and_leave_nothing(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    high = tmp_path / "high.toml"
    high.write_text('[twin]\nmodel = "phenomenological"\n[parameters]\nresonance_hz = 9000.0\n')
    before = sorted(tmp_path.iterdir())
    refused(twingap(tmp_path / "nowhere", "--twin", twin, "--out", out), "nowhere")
    refused(twingap(records, "--twin", tmp_path / "nowhere.toml", "--out", out), "nowhere.toml")
    refused(twingap(records, "--twin", twin, "--out", out, "--method", "guess"), "'guess'", "Non-DA")
    refused(twingap(records, "--twin", twin, "--out", tmp_path), "folder")
    refused(twingap(records, "--twin", twin, "--out", "/proc/nothing/out.csv"), "/proc/nothing")
    refused(twingap(records, "--twin", high, "--out", out, *QUICK), "9000 Hz", "above half the sampling rate")
    refused(twingap(records, "--twin", twin, "--out", out, "--machines", 3), "machines")
    refused(twingap(records, "--twin", twin), "--out")
    for read in (twin, records / "records.csv", records / "recordset.toml"):
        text = read.read_bytes()
        refused(twingap(records, "--twin", twin, "--out", read, *QUICK), read.name, "name another file")
        assert read.read_bytes() == text
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("samples", "head", "says"),
    [
        (np.r_[np.ones(900), np.nan], "", "nan"),
        (np.ones(900), "", "all samples are equal"),
        (np.arange(100.0), "", "100 samples, at least 512 expected: the power of two with 3 turns"),
        (np.arange(900.0) % 7, "fs_hz = 800", "800 Hz"),
        (np.arange(900.0) % 7 * 1e200, "", "spread over 6e+200"),
        (np.arange(900.0) % 7 * 1e-200, "", "spread over 6e-200"),
    ],
    ids=["nan", "constant", "short", "rate", "huge", "tiny"],
)
def test_records_that_cannot_be_classified(
    twingap: Run, twin: Path, tmp_path: Path, samples: np.ndarray, head: str, says: str
) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "recordset.toml").write_text(f'[recordset]\nname = "x"\n{head or "fs_hz = 8000"}\n')
    (folder / "records.csv").write_text("record,file,speed_rpm\na,a.npy,4800\n")
    np.save(folder / "a.npy", samples)
    refused(twingap(folder, "--twin", twin, "--out", tmp_path / "out.csv", *QUICK), "[bearing]")
    with twin.open("a", encoding="utf-8") as stream:
        stream.write("[bearing]\nname = '6205'\nn_rollers = 9\nroller_diameter_mm = 7.94\npitch_diameter_mm = 39.04\n")
    refused(twingap(folder, "--twin", twin, "--out", tmp_path / "out.csv", *QUICK), says)
    assert not (tmp_path / "out.csv").exists()


def test_a_dead_record_is_left_out_and_that_is_said(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    shutil.copytree(records, folder)
    before = twingap(folder, "--twin", twin, "--out", tmp_path / "whole.csv", "--no-match")
    for name, samples in (("flat", np.full(2048, 0.5)), ("broken", np.r_[np.ones(2047), np.nan])):
        np.save(folder / f"{name}.npy", samples)
        with (folder / "records.csv").open("a", encoding="utf-8") as stream:
            header = (folder / "records.csv").read_text("utf-8").splitlines()[0].split(",")
            cells = {"record": name, "file": f"{name}.npy", "speed_rpm": "4800"}
            stream.write(",".join(cells.get(column, "") for column in header) + "\n")
    said = twingap(folder, "--twin", twin, "--out", tmp_path / "rest.csv", "--no-match")
    assert before.status == said.status == 0
    assert (tmp_path / "rest.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert "left out, since it cannot be classified: record 'flat': all samples are equal, and 1 more" in said.out


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root writes anywhere")
def test_a_folder_without_permission(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    shut = tmp_path / "shut"
    shut.mkdir(mode=0o500)
    refused(twingap(records, "--twin", twin, "--out", shut / "out.csv"), "cannot be written")
