"""Record sets: exact round trips, faults named by file, row and column, splits that leak nothing."""

from __future__ import annotations

import os
import pickle
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.io import savemat, wavfile

from twingap.bearing import BEARINGS, FAULTS
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.records.folder import read_record_set, write_record_set

BEARING = BEARINGS["6205"]
TOML = """
[recordset]
name = "rig-7"
fs_hz = 12000
unit = "m/s^2"

[bearing]
name = "6205"
n_rollers = 9
roller_diameter_mm = 7.94
pitch_diameter_mm = 39.04
contact_angle_deg = 0.0
"""
X = np.sin(np.arange(50.0))


def _folder(place: Path, rows: str, toml: str = TOML) -> Path:
    """A record set with files x.npy, two.npz and x.wav."""
    place.mkdir(parents=True, exist_ok=True)
    (place / "recordset.toml").write_text(toml, encoding="utf-8")
    (place / "records.csv").write_text(rows, encoding="utf-8", newline="")
    np.save(place / "x.npy", X)
    np.savez(place / "two.npz", a=X, b=2 * X)
    wavfile.write(place / "x.wav", 12000, X)
    return place


def _condition(i: int, **more: Any) -> Condition:
    return Condition(f"r{i}", 1800.0, 12000.0, **{"n_samples": X.size, **more})


def _set(conditions: list[Condition]) -> RecordSet:
    rng = np.random.default_rng(0)
    records = (Record(c, rng.standard_normal(c.n_samples)) for c in conditions)
    return RecordSet.from_records("a set", "g", BEARING, records)


def test_a_record_set_as_the_specification_has_it(tmp_path: Path) -> None:
    rows = (
        "\ufeffrecord,file,channel,speed_rpm,fault,load_n,time_s,fs_hz,group,hp,serial,note\r\n"
        'r1,two.npz,b,1797,inner,500,0,,g,2,007,"a, b"\r\n'
        "\r\n"
        "r 2 , x.npy,, 1.5e3 ,,,10.5,48000,,,8,\r\n"
        "r3,x.wav,,1500,healthy,,,,g,1.5,,c\r\n"
        "\r\n,,,,,,,,,,,\r\n"
    )
    records = read_record_set(_folder(tmp_path / "a b ü", rows))
    assert (records.name, records.unit, records.bearing, len(records)) == ("rig-7", "m/s^2", BEARING, 3)
    assert records.conditions == (
        Condition("r1", 1797.0, 12000.0, 50, "inner", 500.0, 0.0, "g", {"hp": 2.0, "serial": "007", "note": "a, b"}),
        Condition("r 2", 1500.0, 48000.0, 50, None, None, 10.5, "r 2", {"hp": None, "serial": "8", "note": None}),
        Condition("r3", 1500.0, 12000.0, 50, "healthy", None, None, "g", {"hp": 1.5, "serial": None, "note": "c"}),
    )
    np.testing.assert_array_equal(records[0].samples, 2 * X)
    np.testing.assert_array_equal(records[-1].samples, X)
    assert records.groups == ("g", "r 2")
    assert list(records.table.columns)[-3:] == ["hp", "serial", "note"]


def test_what_may_be_left_out(tmp_path: Path) -> None:
    rows = "file,record,fs_hz,speed_rpm\nx.npy,r1,100,60"
    records = read_record_set(_folder(tmp_path / "plain", rows, "[recordset]\n"))
    assert (records.name, records.unit, records.bearing) == ("plain", "", None)
    assert records.conditions == (Condition("r1", 60.0, 100.0, 50),)


def test_files_may_lie_elsewhere_but_not_at_absolute_places(tmp_path: Path) -> None:
    _folder(tmp_path / "data", "")
    np.testing.assert_array_equal(
        read_record_set(_folder(tmp_path / "set", "record,file,speed_rpm\nr1,../data/x.npy,60\n"))[0].samples, X
    )
    for name in (f"{tmp_path}/data/x.npy", r"C:\data\x.npy"):
        with pytest.raises(TwingapError, match="is an absolute path; name it relative to the folder"):
            read_record_set(_folder(tmp_path / "set", f"record,file,speed_rpm\nr1,{name},60\n"))


HEAD = "record,file,channel,speed_rpm,fault,load_n,fs_hz\n"


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ("", "records.csv: is empty; begin it with the columns record, file, speed_rpm"),
        ("\n\n", "records.csv: is empty"),
        (HEAD, "records.csv: holds no records"),
        ("record,file\nr1,x.npy\n", "records.csv, row 1: column 'speed_rpm' is missing; add it (columns found: "),
        ("record;file;speed_rpm\n", "row 1: column 'record' is missing; add it (separate columns by commas)"),
        ("Record,file,speed_rpm\nr,x.npy,1\n", "row 1: column 'record' is missing"),
        ("record,file,file,speed_rpm\n", "row 1: column 'file' appears twice"),
        (",record,file,speed_rpm\n0,r1,x.npy,60\n", "row 1: column 1 has no name; name it, or write the table without"),
        (HEAD + "r1,x.npy,,60,,\n", "records.csv, row 2: has 6 fields, 7 expected"),
        (HEAD + 'r1,"x.npy,,60,,,\n', "records.csv: is not a comma-separated table: unexpected end of data"),
        (HEAD + "\n,x.npy,,60,,,\n", "records.csv, row 3, column record: is empty"),
        (HEAD + "r1,,,60,,,\n", "records.csv, row 2, column file: is empty"),
        (HEAD + "r1,x.npy,,60,,,\nr1,x.npy,,60,,,\n", "row 3, column record: record 'r1' appears twice, first"),
        (HEAD + "r1,x.npy,,,,,\n", "records.csv, row 2, column speed_rpm: is empty; fill it in"),
        (HEAD + "r1,x.npy,,-60,,,\n", "row 2, column speed_rpm: '-60' found, a positive number expected"),
        (HEAD + "r1,x.npy,,0,,,\n", "column speed_rpm: '0' found, a positive number expected"),
        (HEAD + "r1,x.npy,,nan,,,\n", "column speed_rpm: 'nan' found"),
        (HEAD + "r1,x.npy,,fast,,,\n", "column speed_rpm: 'fast' found"),
        (HEAD + "r1,x.npy,,1_000,,,\n", "column speed_rpm: '1_000' found"),
        (HEAD + "r1,x.npy,,60,Inner,,\n", "column fault: unknown fault 'Inner'; use one of healthy"),
        (HEAD + "r1,x.npy,,60,,-1,\n", "column load_n: '-1' found, a number of at least 0 expected"),
        (HEAD + "r1,x.npy,,60,,,inf\n", "column fs_hz: 'inf' found, a positive number expected"),
        (HEAD + "r1,y.npy,,60,,,\n", "records.csv, row 2, column file: SET/y.npy: no such file; check the name"),
        (HEAD + "r1,.,,60,,,\n", "row 2, column file: SET: is a folder, a file expected"),
        (HEAD + "r1,two.npz,,60,,,\n", "row 2, column channel: SET/two.npz: holds 2 channels and none is named; name"),
        (HEAD + "r1,two.npz,c,60,,,\n", "row 2, column channel: SET/two.npz: has no channel 'c'; it has a, b"),
        (HEAD + "r1,records.csv,,60,,,\n", "row 2, column channel: SET/records.csv: holds 7 channels and none is"),
        (HEAD + "r1,x\0.npy,,60,,,\n", "row 2, column file: 'SET/x\\x00.npy': is no file name"),
        (HEAD + "r1,x.wav,,60,,,8000\n", "row 2, column fs_hz: SET/x.wav states 12000 Hz but the record set 8000 Hz"),
    ],
)  # fmt: skip
def test_faults_in_the_table_are_named_by_row_and_column(tmp_path: Path, rows: str, reason: str) -> None:
    folder = _folder(tmp_path / "s", rows)
    with pytest.raises(TwingapError) as caught:
        read_record_set(folder)
    assert reason.replace("SET", str(folder)) in str(caught.value)
    assert str(caught.value).startswith(str(folder / "records.csv"))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (TOML, "", "recordset.toml: key 'recordset' is missing"),
        ("fs_hz = 12000", "", "records.csv, row 2, column fs_hz: no sampling rate is given; add a column fs_hz"),
        ("fs_hz = 12000", "fs_hz = 0", "recordset.toml: recordset: fs_hz = 0.0, a positive number expected"),
        ("fs_hz = 12000", "fs_hz = '12 kHz'", "recordset.toml: recordset: fs_hz: '12 kHz' found, a finite number"),
        ("fs_hz = 12000", "fs = 12000", "recordset.toml: recordset: unknown key 'fs'; known keys: name, fs_hz, unit"),
        ('"m/s^2"', '"mm/s"', 'recordset.toml: recordset: unit = \'mm/s\'; use "m/s^2", "g" or "" (unknown)'),
        ("n_rollers = 9", "", "recordset.toml: bearing: key 'n_rollers' is missing; add n_rollers = a whole number"),
        ("n_rollers = 9", "n_rollers = 9.5", "recordset.toml: bearing: n_rollers: 9.5 found, a whole number expected"),
        (
            "= 7.94",
            "= 50",
            "recordset.toml: bearing: bearing '6205': roller_diameter_mm = 50, pitch_diameter_mm = 39.04",
        ),
        ("[bearing]", "[baering]", "recordset.toml: unknown key 'baering'; known keys: recordset, bearing"),
        ("[bearing]", "[bearing", "recordset.toml: is not valid TOML"),
    ],
)
def test_faults_in_the_description_are_named_by_key(tmp_path: Path, old: str, new: str, reason: str) -> None:
    folder = _folder(tmp_path, "record,file,speed_rpm\nr1,x.npy,60\n", TOML.replace(old, new))
    with pytest.raises(TwingapError) as caught:
        read_record_set(folder)
    assert reason in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def test_folders_that_are_no_record_sets(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match=r"gone: no such folder; name the folder that holds recordset.toml"):
        read_record_set(tmp_path / "gone")
    with pytest.raises(TwingapError, match=r"holds no recordset.toml; .*twingap import"):
        read_record_set(tmp_path)
    with pytest.raises(TwingapError, match=r"cannot be read: File name too long"):
        read_record_set(tmp_path / ("x" * 300))
    _folder(tmp_path, "")
    with pytest.raises(TwingapError, match=r"recordset.toml: is not a folder"):
        read_record_set(tmp_path / "recordset.toml")
    (tmp_path / "records.csv").unlink()
    with pytest.raises(TwingapError, match=r"records.csv: cannot be read: No such file"):
        read_record_set(tmp_path)
    (tmp_path / "records.csv").write_bytes("record,file,speed_rpm\nr,größe.npy,1".encode("latin-1"))
    with pytest.raises(TwingapError, match=r"records.csv: is not UTF-8 text; save it as UTF-8"):
        read_record_set(tmp_path)


def test_values_are_checked_when_a_record_is_taken(tmp_path: Path) -> None:
    folder = _folder(tmp_path, "record,file,speed_rpm\nr1,x.npy,60\nr2,bad.npy,60\n")
    np.save(folder / "bad.npy", [0.0, np.nan])
    records = read_record_set(folder)
    assert records[0].samples.size == 50
    with pytest.raises(TwingapError, match=r"records.csv, row 3, column file: .*bad.npy.*: sample 1 is nan, finite"):
        records[1]
    np.save(folder / "x.npy", X[:10])
    with pytest.raises(TwingapError, match="holds 10 samples, 50 expected"):
        records[0]
    (folder / "x.npy").unlink()
    with pytest.raises(TwingapError, match=r"row 2, column file: .*x.npy: cannot be read: No such file"):
        records.without_labels().take([0])[0]


NAMES = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=8).filter(lambda s: s == s.strip())
TEXTS = NAMES.filter(lambda s: not any(c in "0123456789" for c in s) and s.lower() not in ("true", "false", "inf"))
COLUMN = st.sampled_from([
    st.none() | st.integers(-(10**20), 10**20),
    st.none() | st.floats(allow_nan=False).map(lambda v: v + 0.0),
    st.none() | st.booleans(),
    st.none() | TEXTS.filter(lambda s: s.lstrip("+-").lower() != "inf"),
])  # fmt: skip
POSITIVE = st.floats(1e-6, 1e9)


@st.composite
def _sets(draw: st.DrawFn) -> RecordSet:
    names = draw(st.lists(NAMES, unique=True, min_size=1, max_size=5))
    reserved = ("record", "file", "channel", "speed_rpm", "fault", "load_n", "time_s", "fs_hz", "group")
    columns = draw(st.dictionaries(NAMES.filter(lambda c: c not in reserved), COLUMN, max_size=3))
    conditions = [
        Condition(
            name, draw(POSITIVE), draw(POSITIVE), draw(st.integers(1, 5)), draw(st.none() | st.sampled_from(FAULTS)),
            draw(st.none() | st.floats(0, 1e9)), draw(st.none() | st.floats(-1e9, 1e9)), draw(st.none() | NAMES),
            {column: draw(values) for column, values in columns.items()},
        )
        for name in names
    ]  # fmt: skip
    samples = st.floats(allow_nan=False, allow_infinity=False)
    records = [
        Record(c, np.array(draw(st.lists(samples, min_size=c.n_samples, max_size=c.n_samples)))) for c in conditions
    ]
    bearing, unit = draw(st.sampled_from([None, BEARING])), draw(st.sampled_from(["m/s^2", "g", ""]))
    return RecordSet.from_records(draw(NAMES), unit, bearing, records)


@given(_sets())
@settings(max_examples=100, deadline=None)
def test_what_is_written_is_read_back_to_the_last_bit(records: RecordSet) -> None:
    with tempfile.TemporaryDirectory() as folder:
        back = read_record_set(write_record_set(records, Path(folder) / "set"))
        assert (back.name, back.unit, back.bearing) == (records.name, records.unit, records.bearing)
        assert back.conditions == records.conditions
        for mine, theirs in zip(records, back, strict=True):
            assert mine.samples.tobytes() == theirs.samples.tobytes()
        for a, b in zip(records.conditions, back.conditions, strict=True):  # 1 and 1.0 and True are equal, but differ
            if all(isinstance(v, int) for c in records.conditions for v in c.extra.values()):
                assert list(map(type, a.extra.values())) == list(map(type, b.extra.values()))
        assert back.digest == records.digest


def test_awkward_text_survives(tmp_path: Path) -> None:
    texts = [
        "a\rb",
        "a\nb",
        "a\r\nb",
        'a"b',
        '"',
        "a,b",
        ",",
        "#",
        "'",
        "a\u2028b",
        "\ufeff",
        "=1+1",
        "-",
        "nan",
        "007",
        "größe",
    ]
    records = _set([Condition(t, 1.0, 1.0, 1, group=t + "g", extra={"e " + t: t, "f": t}) for t in texts])
    assert [c.name for c in read_record_set(write_record_set(records, tmp_path / "s")).conditions] == texts
    for one in range(len(texts)):
        back = read_record_set(write_record_set(records.take([one]), tmp_path / str(one)))
        assert back.conditions == records.take([one]).conditions


def test_one_file_may_serve_many_records(tmp_path: Path) -> None:
    rows = "record,file,channel,speed_rpm\n" + "".join(f"r{i},two.npz,{'ab'[i % 2]},60\n" for i in range(20))
    records = read_record_set(_folder(tmp_path, rows))
    np.testing.assert_array_equal(records[19].samples, 2 * X)


def test_the_digest_is_of_what_the_records_say(tmp_path: Path) -> None:
    records = _set([_condition(i, extra={"a": i}) for i in range(3)])
    digest = records.digest
    savemat(tmp_path / "x.mat", {"x": 1.0})
    assert RecordSet("other name", "g", BEARING, records.conditions, lambda i: records[i].samples).digest == digest
    changed = [
        RecordSet("", "", BEARING, records.conditions, lambda i: records[i].samples),
        RecordSet("", "g", None, records.conditions, lambda i: records[i].samples),
        RecordSet("", "g", BEARING, records.conditions, lambda i: records[i].samples + 1e-15 * (i == 2)),
        records.take([1, 0, 2]),
        records.take([0, 1]),
        _set([_condition(i, extra={"a": i}, fault="inner" if i == 1 else None) for i in range(3)]),
        _set([_condition(i, extra={"a": i + 1}) for i in range(3)]),
    ]
    digests = {c.digest for c in changed}
    assert len(digests) == len(changed)
    assert digest not in digests


def test_sets_travel_to_worker_processes(tmp_path: Path) -> None:
    held = _set([_condition(i) for i in range(3)])
    for records in (held, read_record_set(write_record_set(held, tmp_path / "s"))):
        there = pickle.loads(pickle.dumps(records.take([2, 0]).without_labels()))
        np.testing.assert_array_equal(there[0].samples, held[2].samples)


ROWS = 'record,file,channel,speed_rpm,fault,fs_hz,group,note\nr1,two.npz,b,60,inner,,g,"a"\nr2,x.npy,,60,,9,g,1\n'
EDITS = st.lists(
    st.tuples(
        st.floats(0, 1),
        st.integers(0, 6),
        st.text(st.sampled_from("rx.npy,\"\n\r0-19e_=[]'#{}ü\0\ufeff /\\"), max_size=4)
        | st.sampled_from(["nan", "inf", "1e999", '""', ",,", "../", "two.npz", "x.wav", "healthy", "record"]),
    ),
    max_size=5,
)


def _edited(text: str, edits: list[tuple[float, int, str]]) -> str:
    for place, length, new in edits:
        at = int(place * len(text))
        text = text[:at] + new + text[at + length :]
    return text


@given(rows=EDITS, toml=EDITS, which=st.sampled_from(["rows", "toml", "both"]))
@settings(max_examples=400, deadline=None)
def test_any_text_is_a_record_set_or_one_line(
    rows: list[tuple[float, int, str]], toml: list[tuple[float, int, str]], which: str
) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = _folder(
            Path(place) / "s",
            ROWS if which == "toml" else _edited(ROWS, rows),
            TOML if which == "rows" else _edited(TOML, toml),
        )
        try:
            records = read_record_set(folder)
            samples = [record.samples for record in records]
        except TwingapError as error:
            assert "\n" not in str(error)
            assert place in str(error)
            return
        assume(all(np.isfinite(x).all() for x in samples))
        again = read_record_set(write_record_set(records, Path(place) / "again"))
        assert again.conditions == records.conditions
        assert again.digest == records.digest


@pytest.mark.data
@pytest.mark.skipif("TWINGAP_DATA" not in os.environ, reason="needs real records: set TWINGAP_DATA")
def test_a_real_cwru_recording(tmp_path: Path) -> None:
    (tmp_path / "recordset.toml").write_text(TOML.replace("m/s^2", "g"))
    (tmp_path / "data").symlink_to(Path(os.environ["TWINGAP_DATA"]) / "cwru")
    (tmp_path / "records.csv").write_text(
        "record,file,channel,speed_rpm,fault,fs_hz,hp\n"
        "105,data/105.mat,X105_DE_time,1797,inner,,0\n"
        "97,data/97.mat,X097_DE_time,1796,healthy,48000,0\n"
    )
    records = read_record_set(tmp_path)
    assert [c.n_samples for c in records.conditions] == [121_265, 243_938]
    assert 0.2 < np.std(records[0].samples) < 0.4  # g
    assert 0.05 < np.std(records[1].samples) < 0.1
    assert read_record_set(write_record_set(records, tmp_path / "copy")).digest == records.digest
    (tmp_path / "records.csv").write_text("record,file,channel,speed_rpm\n105,data/105.mat,,1797\n")
    with pytest.raises(
        TwingapError, match=r"column channel: .*105.mat: holds 4 channels and none is named; name one of X"
    ):
        read_record_set(tmp_path)


def test_a_notebook_shows_what_a_set_holds() -> None:
    conditions = [Condition(f"r{i}", 1500.0 + 300 * i, 12000.0, 4, fault) for i, fault in enumerate(("inner", None))]
    made = RecordSet.from_records("<b>", "g", None, [Record(c, np.zeros(4)) for c in conditions])
    shown = made._repr_html_()
    for part in ("&lt;b&gt;", "1 inner, 1 unknown", "1500 to 1800", "<td>12000</td>", "<td>g</td>"):
        assert part in shown
