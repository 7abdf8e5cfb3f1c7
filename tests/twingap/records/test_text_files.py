"""Text files as data loggers and oscilloscopes export them: read as they are meant, or refused with the line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.errors import TwingapError
from twingap.records.samples import inspect, load

T = np.arange(40) / 12000
X = np.round(np.sin(np.arange(40.0)), 6)


def _table(separator: str, decimal: str = ".", head: str = "time{0}x\n", end: str = "\n") -> str:
    rows = (f"{t:.6f}{separator}{x:.6f}" for t, x in zip(T, X, strict=True))
    return head.format(separator) + end.join(row.replace(".", decimal) for row in rows) + end


KINDS: dict[str, tuple[str, str, str]] = {
    "semicolons and decimal commas": ("x.csv", _table(";", ","), "numbers have decimal commas"),
    "lines above the table": (
        "x.csv",
        _table(";", head="Serial Number: 123\nRate: 12000\n\ntime{0}x\n"),
        "2 lines above the table are left out, the first 'Serial Number: 123'",
    ),
    "row of units": ("x.csv", _table(",", head="time,x\ns,g\n"), "units: time in s, x in g"),
    "tabs": ("x.txt", _table("\t"), "fields are separated by tabs"),
    "tabs and decimal commas": ("x.tsv", _table("\t", ","), "numbers have decimal commas"),
    "bars": ("x.txt", _table("|"), "fields are separated by bars"),
    "blanks": ("x.asc", _table("   "), "fields are separated by blanks"),
    "blanks at both ends": (
        "x.dat",
        "time x\n" + "".join(f"  {t:.6f}\t {x: .6f}  \r\n" for t, x in zip(T, X, strict=True)),
        "fields are separated by tabs",
    ),
    "old Mac": ("x.csv", _table(";", end="\r"), "fields are separated by semicolons"),
    "plus signs": ("x.csv", _table(",").replace(",0", ",+0"), ""),
    "Excel": ("x.csv", _table(";", ",", head="sep=;\ntime{0}x\n"), "1 line above the table is left out"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_logger_export_is_read_and_what_was_found_is_noted(tmp_path: Path, kind: str) -> None:
    name, text, note = KINDS[kind]
    (tmp_path / name).write_text(text, newline="")
    file = inspect(tmp_path / name)
    assert file.find("x").n_samples == X.size
    np.testing.assert_array_equal(file.find("x").load(), X)
    np.testing.assert_array_equal(file.find("time").load(), np.round(T, 6))
    assert any(note in found for found in file.notes) or not note


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"])
def test_encodings_are_found(tmp_path: Path, encoding: str) -> None:
    text = "Zeit [s];Beschl. [m/s²]\r\n" + _table(";", ",", head="", end="\r\n")
    (tmp_path / "x.txt").write_bytes(text.encode(encoding))
    file = inspect(tmp_path / "x.txt")
    assert [(c.name, c.unit) for c in file.channels] == [("Zeit [s]", "s"), ("Beschl. [m/s²]", "m/s²")]
    np.testing.assert_array_equal(file.find("Beschl. [m/s²]").load(), X)


GCDC = (
    ";Title, http://www.gcdataconcepts.com, x16-1d, ADXL345\n;Start_time, 2016-01-04, 10:25:14.000\n"
    ";SampleRate, 100,Hz\n;Deadband, 0, counts\n;Headers, time,Ax,Ay,Az\n"
    "0.003,799,650,-1773\n0.013,805,661,-1808\n0.023,766,687,-1844\n"
)
HIOKI = (
    '"COMMENT", "8807 MEM DATA"\n"DATE", "01-01-1999"\n"NUM_SIGS", 3\n"INTERVAL", 2.500E-03\n"HORZ_UNITS", "S"\n'
    '"VERT_UNITS", "S", "V", "V"\n"SIGNAL", "TIME", "ACH1", "ACH2"\n"DATA"\n'
    "0.0000E+00, +1.2500E-01, -7.0000E-01\n+2.5000E-03, +2.5000E-02, -7.0000E-01\n+5.0000E-03, -2.5E-02, -6.75E-01\n"
)
LECROY = (
    "LECROY9354,935412345\nSegments,1,SegmentSize,502\nSegment,Trig Time,TimeSinceFirstSegment\n"
    "#1,21 Mar 1990 9:37:08,0.0\nTime,Ampl\n0.0,1\n0.1,2\n0.2,3\n0.3,5\n"
)
LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\n"
    "X_Columns\tOne\nDate\t2016/08/11\nTime\t14:37:48.201\n***End_of_Header***\t\n\t\n"
    "Notes\tX values guaranteed valid only for Dev0/Ai0\t\t\nChannels\t2\t\t\nSamples\t3\t3\t\n"
    "X_Dimension\tTime\tTime\t\nX0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\nDelta_X\t0.010000\t0.010000\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tVoltage\tVoltage_0\tComment\n"
)
OCTAVE = "# Created by Octave 6.2.0\n# name: x\n# type: matrix\n# rows: 3\n# columns: 1\n 1\n 2\n 3.5\n\n\n"
RIGOL = "X,CH1,Start,Increment,\nSequence,Volt,-6.0e-04,1.0e-06\n0,1.2e-1,,\n1,1.3e-1,,\n2,1.1e-1,,\n"
SIGLENT = (
    "Record Length,Analog:14000000\nSample Interval,CH1:5.00E-08\nVertical Units,CH1:V\nSource,CH1\nSecond,Value\n"
    "-0.35,0.12\n-0.34,0.13\n-0.33,0.12\n"
)
YOKOGAWA = (
    '"Header Size",10\n"Model Name","DL850"\n"SampleRate","1.0E+06"\n"VUnit","V"\n"TraceName","CH1"\n\n'
    "0.1\n0.2\n0.3\n0.4\n0.5\n0.6\n"
)
GERMAN = (
    "Messung;Prüfstand 7\nAbtastrate [Hz];25600\nKanal;Beschl. A;Beschl. B\nZeit;A;B\ns;m/s²;m/s²\n"
    "0,0;0,1;0,2\n0,1;0,15;0,25\n0,2;0,1;0,2\n0,3;0,1;0,2\n0,4;0,1;0,2\n"
)

EXPORTS: dict[str, tuple[str, str, str | None, list[float], float | None]] = {
    "GCDC X16 (manual, figure 19)": ("x.csv", GCDC, "Az", [-1773, -1808, -1844], 100),
    "Hioki 8807 (manual, 12.5)": ("x.txt", HIOKI, "ACH1", [0.125, 0.025, -0.025], None),
    "LeCroy 9300 (manual, E-11)": ("x.csv", LECROY, "Ampl", [1, 2, 3, 5], None),
    "LabVIEW, a column too many (ladisk/lvm_read#5)": (
        "x.lvm",
        LVM + "0.000000\t1.0\t2.0\n0.010000\t2.0\t3.0\n0.020000\t3.0\t4.0\n",
        "Voltage_0",
        [2, 3, 4],
        100,
    ),
    "LabVIEW with comments (ladisk/lvm_read#12)": (
        "x.lvm",
        LVM + "0.000000\t1.0\t2.0\tstart\n0.010000\t2.0\t3.0\t\n0.020000\t3.0\t4.0\t\n0.030000\t5.0\t4.0\t\n",
        "Voltage",
        [1, 2, 3, 5],
        100,
    ),
    "LabVIEW with decimal commas": (
        "x.lvm",
        (LVM + "0.000000\t1.0\t2.0\n0.010000\t2.0\t3.25\n0.020000\t3.0\t4.0\n").replace(".", ","),
        "Voltage_0",
        [2, 3.25, 4],
        100,
    ),
    "Octave (save -text)": ("x.txt", OCTAVE, None, [1, 2, 3.5], None),
    "PicoScope (guide, 6.1.1)": (
        "x.csv",
        "Time, Channel A, Channel B\n(µs), (V), (V)\n\n-500.004, 5.511, 1.215\n-500.002, 4.724, 2.13\n-500, 5.552, 2\n",
        "Channel A",
        [5.511, 4.724, 5.552],
        None,
    ),
    "PicoScope, tabs, German": (
        "x.txt",
        "Time\tChannel A\n(ms)\t(mV)\n\n-0,50000\t5,511\n-0,4999\t4,7245\n",
        "Channel A",
        [5.511, 4.7245],
        None,
    ),
    "Twin Builder (CSV file format)": (
        "x.csv",
        '"Time [ms]", "R1.V [V]", "C1.I [uA]"\n0,4.2,2.0\n1.33,4.1,1.95\n2.0,3.9,1.8\n',
        "R1.V [V]",
        [4.2, 4.1, 3.9],
        None,
    ),
    "times of day": (
        "x.csv",
        "DateTime;Magnitude;X\n2015-01-01 12:00:00.00;82.56;-38.31\n2015-01-01 12:00:00.01;82.5;-38.3\n",
        "X",
        [-38.31, -38.3],
        None,
    ),
    "R&S RTM (manual)": ("x.csv", "in s,C1 in V\n-4.9E-3,1.2E-3\n-4.8E-3,1.3E-3\n", "C1 in V", [0.0012, 0.0013], None),
    "Rigol DS1000Z": ("x.csv", RIGOL, "CH1", [0.12, 0.13, 0.11], None),
    "Siglent": ("x.csv", SIGLENT, "Value", [0.12, 0.13, 0.12], None),
    "Saleae": ("x.csv", "Time[s], Channel 0\n0.0, 1.2\n0.1, 1.3\n", "Channel 0", [1.2, 1.3], None),
    "Yokogawa DL (manual, appendix 5)": ("x.csv", YOKOGAWA, None, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], 1e6),
    "a German logger": ("x.csv", GERMAN, "B", [0.2, 0.25, 0.2, 0.2, 0.2], 25600),
    "PRONOSTIA with semicolons": ("x.csv", "9;39;39;65664;0.552;-1\n9;39;39;65703;0.5;-2\n", "4", [0.552, 0.5], None),
    "gnuplot": ("x.dat", "#time\tacc\n0.0\t1.0\n0.1\t2.0\n", "acc", [1, 2], None),
    "MATLAB (save -ascii)": ("x.txt", "   1.0000e+00  -2.5000e+00\n   2.0000e+00   3.0e+00\n", "1", [-2.5, 3], None),
    "pandas with an index": ("x.csv", ";x\n0;1.5\n1;2.5\n", "x", [1.5, 2.5], None),
    "kHz": ("x.txt", "Sampling frequency: 25.6 kHz\n\n0.1\n0.2\n", None, [0.1, 0.2], 25600),
    "a full scale is no rate": ("x.txt", "FS: 10 V\nx\n0.1\n0.2\n", None, [0.1, 0.2], None),
}  # fmt: skip


@pytest.mark.parametrize("export", EXPORTS)
def test_public_exports_are_read(tmp_path: Path, export: str) -> None:
    name, text, channel, values, fs_hz = EXPORTS[export]
    (tmp_path / name).write_text(text, encoding="utf-8")
    file = inspect(tmp_path / name)
    np.testing.assert_allclose(file.find(channel).load(), values, rtol=1e-15)
    assert file.fs_hz == (None if fs_hz is None else pytest.approx(fs_hz, rel=1e-9))


@pytest.mark.parametrize(
    ("text", "channel", "reason"),
    [
        (_table(",", ","), "x", "has decimal commas in a comma-separated file"),
        (_table(",", ",", head=""), "1", "has decimal commas in a comma-separated file"),
        ("1;1,234\n2;5,678\n", "1", "'1,234' may have a decimal comma or a comma between thousands"),
        ("x\nOVERLOAD\n0.1\n0.2\n", "x", "line 2, column x: 'OVERLOAD' found, a number expected"),
        ("time,x\n0.0,OVER\n0.1,2\n0.2,3\n", "x", "line 2: mixes numbers ('0.0') and text ('OVER')"),
        ("time,x\n0.0;0.1\n0.1,2\n0.2,3\n", "1", "line 2: has 1 fields, 2 expected"),
        ("0.0 0.1\n0.1,2\n0.2,3\n0.3,3\n", "1", "line 1: has 1 fields, 2 expected"),
        ("time;x\n0.0;0.1\n0.1;\n0.2;3\n", "x", "line 3, column x: is empty"),
        ("time;x\n0,0;0,1\n0,1;0.2\n0,2;0,3\n", "x", "line 3, column x: '0.2' found, a number expected"),
        ("t x\n0 1\n1 2 3\n2 3\n4 5\n5 6\n6 7\n", "x", "line 3: has 3 fields, 2 expected; separate fields by blanks"),
    ],
)
def test_what_may_be_read_in_two_ways_is_refused(tmp_path: Path, text: str, channel: str, reason: str) -> None:
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(TwingapError) as caught:
        load(tmp_path / "x.csv", channel)
    assert str(caught.value).startswith(str(tmp_path / "x.csv"))
    assert reason in str(caught.value)


def test_a_fault_far_below_the_first_lines_is_named(tmp_path: Path) -> None:
    rows = [f"{i / 10};{i % 7}" for i in range(20_000)]
    rows[15_000] = "1500.0;2,5"
    (tmp_path / "x.csv").write_text("time;x\n" + "\n".join(rows))
    with pytest.raises(TwingapError, match=r"line 15002, column x: '2,5' found, a number expected"):
        load(tmp_path / "x.csv", "x")


def test_windows_as_rows_of_text_are_read_by_row(tmp_path: Path) -> None:
    windows = np.round(np.random.default_rng(0).normal(size=(90, 80)), 3)
    np.savetxt(tmp_path / "x.csv", windows, fmt="%.3f", delimiter=",")
    with pytest.raises(TwingapError, match=r"has 80 columns of 90 samples, which are windows .*name a row"):
        load(tmp_path / "x.csv", "0")
    np.testing.assert_array_equal(load(tmp_path / "x.csv", "row 89"), windows[89])
    with pytest.raises(TwingapError, match="has no row 90; it has 90 rows"):
        load(tmp_path / "x.csv", "row 90")


@given(
    values=st.lists(st.floats(-1e3, 1e3).map(lambda v: round(v, 5)), min_size=3, max_size=30),
    separator=st.sampled_from([";", "\t", "|", " ", "   "]),
    comma=st.booleans(),
    head=st.sampled_from(["", "time{0}x\n", "Rate: 10\n\ntime{0}x\n", "# logger 3\n", "time{0}x\ns{0}g\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
@settings(max_examples=80, deadline=None)
def test_every_dialect_gives_the_values_that_were_written(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], separator: str, comma: bool, head: str, encoding: str
) -> None:
    path = tmp_path_factory.mktemp("text") / "x.txt"
    rows = "".join(f"{i / 10:.4f}{separator}{v:.5f}\n" for i, v in enumerate(values))
    path.write_text(head.format(separator) + (rows.replace(".", ",") if comma else rows), encoding=encoding)
    np.testing.assert_array_equal(load(path, "1"), values)
