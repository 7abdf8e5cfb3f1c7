"""Conditions to simulate: from record sets and from tables, with faults named by row and column."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.records.conditions import read_conditions
from twingap.records.folder import write_record_set

CONDITIONS = (
    Condition("r1", 1797.0, 12000.0, 50, "inner", 500.0, 0.0, "g", {"hp": 2}),
    Condition("r2", 1500.0, 48000.0, 70, None, None, None, None, {"hp": None}),
)


def _records() -> RecordSet:
    records = (Record(c, np.ones(c.n_samples)) for c in CONDITIONS)
    return RecordSet.from_records("a", "g", BEARINGS["6205"], records)


def _csv(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("inside", ["", "records.csv", "recordset.toml"])
def test_a_record_set_gives_its_conditions_bearing_and_unit(tmp_path: Path, inside: str) -> None:
    folder = write_record_set(_records(), tmp_path / "a set")
    assert read_conditions(folder / inside) == (CONDITIONS, BEARINGS["6205"], "g")


def test_a_table_gives_conditions_without_a_bearing(tmp_path: Path) -> None:
    text = (
        "\ufeffrecord,speed_rpm,fault,load_n,time_s,fs_hz,group,n_samples,duration_s,hp\n"
        "r1,1797,inner,500,0,12000,g,50,,2\n\n"
        "r2,1500,,,,48000,,,0.0014583,\n"
    )
    assert read_conditions(_csv(tmp_path / "größe 1.CSV", text)) == (CONDITIONS, None, None)


def test_a_table_may_be_a_records_csv_without_its_samples(tmp_path: Path) -> None:
    (write_record_set(_records(), tmp_path / "set") / "records.csv").rename(tmp_path / "records.csv")
    got, bearing, _ = read_conditions(tmp_path / "records.csv", fs_hz=12000.0, duration_s=0.25)
    assert bearing is None
    assert [(c.name, c.fs_hz, c.n_samples, dict(c.extra)) for c in got] == [
        ("r1", 12000.0, 3000, {"hp": 2}),
        ("r2", 48000.0, 12000, {"hp": None}),
    ]


def test_rate_and_length_of_a_row_come_before_those_for_all(tmp_path: Path) -> None:
    path = _csv(tmp_path / "c.csv", "record,speed_rpm,fs_hz,duration_s\na,60,100,2\nb,60,,\n")
    got, *_ = read_conditions(path, fs_hz=10.0, duration_s=1.0)
    assert [(c.fs_hz, c.n_samples) for c in got] == [(100.0, 200), (10.0, 10)]


@pytest.mark.parametrize("value", [-5.0, 0.0, float("nan"), float("inf")])
@pytest.mark.parametrize("option", ["fs_hz", "duration_s"])
def test_options_that_are_no_size_are_named(tmp_path: Path, option: str, value: float) -> None:
    path = _csv(tmp_path / "c.csv", "record,speed_rpm,fs_hz,duration_s\na,60,100,1\n")  # has them all: used or not
    with pytest.raises(TwingapError) as caught:
        read_conditions(path, **{option: value})
    assert str(caught.value) == f"--{option.replace('_', '-')}: {value:g} found, a positive number expected"


def test_a_length_for_all_that_is_out_of_reach_is_named(tmp_path: Path) -> None:
    path = _csv(tmp_path / "c.csv", "record,speed_rpm\na,60\n")
    with pytest.raises(TwingapError, match=r"^--duration-s: 1e\+09 s at 100 Hz are 1e\+11 samples, 1 to"):
        read_conditions(path, fs_hz=100.0, duration_s=1e9)


@pytest.mark.parametrize("inside", ["", "records.csv"])
def test_a_record_set_takes_no_rate_or_length(tmp_path: Path, inside: str) -> None:
    folder = write_record_set(_records(), tmp_path / "a set")
    for options, named in (
        ({"fs_hz": 48000.0}, "--fs-hz"),
        ({"duration_s": 0.1}, "--duration-s"),
        ({"fs_hz": 48000.0, "duration_s": 0.1}, "--fs-hz and --duration-s"),
    ):
        with pytest.raises(TwingapError) as caught:
            read_conditions(folder / inside, **options)
        assert str(caught.value).startswith(f"{named}: the records of {folder / inside} have rates and lengths of")


HEAD = "record,speed_rpm,fault,fs_hz,n_samples,duration_s\n"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "c.csv: is empty"),
        (HEAD, "c.csv: holds no records"),
        ("record,speed\n", "c.csv, row 1: column 'speed_rpm' is missing; add it (columns found: record, speed)"),
        (
            HEAD + "a,60,,,10,\n",
            "c.csv, row 2, column fs_hz: no sampling rate is given; "
            "add a column fs_hz here, or give one rate for all (--fs-hz)",
        ),
        (
            HEAD + "a,60,,100,,\n",
            "c.csv, row 2: no length is given; "
            "add a column n_samples or duration_s, or give one length for all (--duration-s)",
        ),
        (HEAD + "a,60,,100,1.5,\n", "row 2, column n_samples: 1.5 found, a whole number expected"),
        (HEAD + "a,60,,100,0,\n", "row 2, column n_samples: '0' found, a positive number expected"),
        (
            HEAD + "a,60,,100,10,1\n",
            "row 2, column duration_s: 1 s at 100 Hz are not the 10 samples of column n_samples",
        ),
        (HEAD + "a,60,,100,,1e-9\n", "row 2, column duration_s: 1e-07 samples, 1 to 50000000 expected; check"),
        (HEAD + "a,60,,100,1e12,\n", "row 2, column n_samples: 1e+12 samples, 1 to 50000000 expected"),
        (HEAD + "a,60,,1e300,,1e300\n", "row 2, column duration_s: inf samples"),
        (HEAD + "a,-60,,100,10,\n", "row 2, column speed_rpm: '-60' found, a positive number expected"),
        (HEAD + "a,60,crack,100,10,\n", "row 2, column fault: unknown fault 'crack'; use one of healthy"),
        (HEAD + "a,60,,100,10,\na,60,,100,10,\n", "row 3, column record: record 'a' appears twice, first in row 2"),
    ],
)
def test_faults_are_named_by_row_and_column(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(TwingapError) as caught:
        read_conditions(_csv(tmp_path / "c.csv", text))
    assert reason in str(caught.value)


def test_what_is_neither_a_record_set_nor_a_table(tmp_path: Path) -> None:
    for path, reason in (
        (tmp_path / "gone", "gone: no such file or folder; name a record set or a CSV of conditions"),
        (tmp_path, "holds no recordset.toml"),
        (_csv(tmp_path / "c.txt", ""), "c.txt: is neither a record set nor a CSV"),
    ):
        with pytest.raises(TwingapError) as caught:
            read_conditions(path)
        assert reason in str(caught.value)


@given(st.text(st.sampled_from('ab,"\n\r0-19e_=ü\0 .'), max_size=40))
@settings(max_examples=200, deadline=None)
def test_any_text_is_conditions_or_one_line(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = _csv(Path(folder) / "c.csv", "record,speed_rpm,fs_hz,n_samples,x\na,60,1e3,5,\n" + text)
        try:
            conditions, *_ = read_conditions(path)
            assert conditions[0].name == "a"
        except TwingapError as error:
            assert "\n" not in str(error)
            assert str(path) in str(error)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"name": ""}, "text expected"), ({"n_samples": 1.5}, "whole number"), ({"n_samples": 0}, "whole number"),
        ({"speed_rpm": "1797"}, "positive number"), ({"fs_hz": None}, "positive number"),
    ],
)  # fmt: skip
def test_what_no_record_can_have_is_refused(wrong: dict[str, object], says: str) -> None:
    with pytest.raises(TwingapError, match=says):
        Condition(**{"name": "a", "speed_rpm": 1797.0, "fs_hz": 12000.0, "n_samples": 50} | wrong)  # type: ignore[arg-type]
    assert Condition("a", np.float32(1797), np.int64(12000), np.int32(50)).n_samples == 50
