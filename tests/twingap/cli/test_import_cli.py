"""`twingap import` as it is typed."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from tests.twingap.cli.typed import Run, refused
from twingap.gap.report.at_hand import records_have
from twingap.records import read_record_set

FS = 12000
T = np.arange(2400) / FS
X = np.round(np.random.default_rng(0).standard_normal(T.size), 5)
TACHO = (np.mod(T * 30 + 0.3, 1) < 0.1) * 5.0  # 1800 rpm, a pulse per turn


@pytest.fixture
def twingap(typed: Run) -> Run:
    """Runs `twingap import ...`."""
    return partial(typed, "import")


def export(path: Path, unit: str = "g", tacho: bool = False) -> Path:
    """A German logger's export."""
    lines = ["Messung;7", "Zeit;Beschl. A" + ";Drehzahl" * tacho, f"s;{unit}" + ";V" * tacho]
    for t, x, p in zip(T, X, TACHO, strict=True):
        lines.append(f"{t:.6f};{x:.5f}".replace(".", ",") + f";{p:.1f}".replace(".", ",") * tacho)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="cp1252")
    return path


def test_exports_become_a_record_set(twingap: Run, tmp_path: Path) -> None:
    for fault, speed in (("inner", 1750), ("normal", 1797)):
        export(tmp_path / "exports" / f"{fault}_{speed}rpm.csv")
    out = tmp_path / "neu" / "Prüfstand"
    said = twingap(
        tmp_path / "exports", "--names", "{fault}_{speed_rpm:d}rpm.csv", "--bearing", "6205", "--load-n", 500,
        "--out", out,
    )  # fmt: skip
    assert said.status == 0 and said.err == ""
    assert said.out.splitlines()[-1] == str(out)
    for part in ("2 records understood", "the name", "channel 'Zeit'", "numbers have decimal commas", "12000"):
        assert part in said.out
    records = read_record_set(out)
    assert records.unit == "g" and records.bearing is not None and records.bearing.n_rollers == 9
    found = [(c.name, c.speed_rpm, c.fault, c.load_n, c.fs_hz) for c in records.conditions]
    assert found == [("inner_1750rpm", 1750, "inner", 500, 12000), ("normal_1797rpm", 1797, "healthy", 500, 12000)]
    np.testing.assert_array_equal(records[1].samples, X)


def test_a_dry_run_writes_nothing_and_json_says_all(twingap: Run, tmp_path: Path) -> None:
    file = export(tmp_path / "a.csv", tacho=True)
    said = twingap(file, "--tacho-channel", "Drehzahl", "--dry-run", "--json")
    about = json.loads(said.out)
    (record,) = about["records"]
    assert record["speed_rpm"] == pytest.approx(1800, rel=1e-3) and record["channel"] == "Beschl. A"
    assert record["rate from"] == "channel 'Zeit'" and about["out"] is None
    assert any("no bearing is stated" in note for note in about["notes"])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv"]


@pytest.mark.parametrize(
    "text",
    [
        "time,acc\n",
        "# fs_hz: 12000\ntime [s],acc [g]\n",
        "Sampling rate;12000\nChannel;A\nUnit;g\n",
        "Sampling Rate,12000\nTime,Acceleration\ns,g\n",
    ],
)
def test_an_export_without_its_samples_is_said_to_hold_none(twingap: Run, tmp_path: Path, text: str) -> None:
    """It may state a rate, and a rate may be given: neither is what is missing."""
    (tmp_path / "head.csv").write_text(text)
    for given in ((), ("--fs-hz", FS)):
        said = twingap(tmp_path / "head.csv", "--speed-rpm", 1800, *given, "--dry-run")
        refused(said, "head.csv", "holds no samples", "export it again with its samples")


@pytest.mark.parametrize("cell", ["", "  ", '""'])
def test_a_column_without_values_is_named_before_anything_is_written(twingap: Run, tmp_path: Path, cell: str) -> None:
    file, words = tmp_path / "a.csv", ("--speed-rpm", 1800, "--dry-run")
    file.write_text("time,acc\n" + "".join(f"{t:.6f},{cell}\n" for t in T))
    said = twingap(file, *words)
    refused(said, "a.csv, channel acc: all of its cells are empty; export it again with its values, or take another")
    refused(twingap(file, "--channel", "acc", *words), "channel acc: all of its cells are empty")
    file.write_text("time,acc,other\n" + "".join(f"{t:.6f},{cell},{x}\n" for t, x in zip(T, X, strict=True)))
    said = twingap(file, *words)
    assert said.status == 0 and "1 record understood" in said.out
    assert "channel 'acc' is left out: all of its cells are empty" in " ".join(said.out.split())


def test_a_set_states_that_its_speed_is_from_a_tacho(twingap: Run, tmp_path: Path) -> None:
    """So that reports do not advise to record one."""
    file = export(tmp_path / "a.csv", tacho=True)
    assert twingap(file, "--tacho-channel", "Drehzahl", "--out", tmp_path / "set").status == 0
    conditions = read_record_set(tmp_path / "set").conditions
    assert records_have(conditions) == {"tacho": "column speed_from of records.csv"}
    assert twingap(file, "--speed-rpm", 1800, "--out", tmp_path / "stated").status == 0
    assert records_have(read_record_set(tmp_path / "stated").conditions) == {}


def test_speed_from_a_column_units_and_scale(twingap: Run, tmp_path: Path) -> None:
    table = np.column_stack([T, X, np.full(T.size, 1500.0)])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="time,acc [mV],speed [rpm]", comments="", fmt="%.7f")
    words = (tmp_path / "a.csv", "--speed-channel", "speed [rpm]", "--out", tmp_path / "set")
    said = twingap(*words, "--dry-run")
    assert "is in 'mV', which is no acceleration: give --unit, and --scale" in said.out
    assert twingap(*words, "--unit", "g", "--scale", 0.01).status == 0
    records = read_record_set(tmp_path / "set")
    assert records.conditions[0].speed_rpm == 1500 and records.unit == "g"
    np.testing.assert_allclose(records[0].samples, X / 100, atol=1e-12)


def test_channels_of_one_file_share_a_group(twingap: Run, tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"bearing": {"de": X, "fe": -X, "sr": 12000.0}})
    words = ("--fs-hz", FS, "--speed-rpm", 1800, "--bearing", "8,7.92,34.55", "--out", tmp_path / "s")
    said = twingap(tmp_path / "a.mat", *words)
    assert said.status == 0
    records = read_record_set(tmp_path / "s")
    assert [c.name for c in records.conditions] == ["a bearing.de", "a bearing.fe"]
    assert {c.group for c in records.conditions} == {"a"}
    np.testing.assert_array_equal(records[1].samples, -X)


def test_a_number_in_a_file_of_named_arrays_states_the_rate(twingap: Run, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", acc=X, fs=12000)
    savemat(tmp_path / "b.mat", {"acc": X, "Sampling_Rate": 12000.0, "rpm": 1800.0})
    said = twingap(tmp_path / "a.npz", tmp_path / "b.mat", "--speed-rpm", 1800, "--out", tmp_path / "set")
    assert said.status == 0, said.err
    assert {c.fs_hz for c in read_record_set(tmp_path / "set").conditions} == {12000.0}
    wrong = twingap(tmp_path / "a.npz", "--fs-hz", 9000, "--speed-rpm", 1800, "--out", tmp_path / "x")
    refused(wrong, "--fs-hz gives 9000 Hz but number 'fs' 12000 Hz")
    np.savez(tmp_path / "c.npz", acc=X, fs=12000, sample_rate=50.0)  # one of them is of something else
    refused(twingap(tmp_path / "c.npz", "--speed-rpm", 1800, "--out", tmp_path / "x"), "states no sampling rate")


def test_units_that_differ_are_converted(twingap: Run, tmp_path: Path) -> None:
    files = [export(tmp_path / "a.csv", "g"), export(tmp_path / "b.csv", "m/s²")]
    said = twingap(*files, "--speed-rpm", 1800, "--out", tmp_path / "set")
    assert said.status == 0 and "records are in g, m/s^2: written in g" in said.out
    np.testing.assert_allclose(read_record_set(tmp_path / "set")[1].samples, X / 9.80665, rtol=1e-12)


def test_what_is_missing_or_wrong_is_one_line(twingap: Run, tmp_path: Path) -> None:
    file, out = export(tmp_path / "a.csv"), tmp_path / "set"
    all_at_1800 = ("--speed-rpm", 1800, "--out", out)
    np.save(tmp_path / "x.npy", X)
    refused(twingap(file), "--out", "--dry-run")
    refused(twingap(file, "--out", out), "a.csv", "states no speed", "--tacho-channel")
    refused(twingap(tmp_path / "x.npy", "--speed-rpm", 1, "--out", out), "x.npy", "states no sampling rate", "--fs-hz")
    refused(twingap(file, "--fs-hz", 10000, "--speed-rpm", 1, "--out", out), "--fs-hz gives 10000 Hz but", "12000 Hz")
    refused(twingap(file, "--names", "{fault}_{speed_rpm}.csv", "--out", out), "does not fit the pattern")
    refused(twingap(file, "--names", "{fault}.csv", "--speed-rpm", 1, "--out", out), "unknown fault 'a'", "inner")
    refused(twingap(file, "--names", "a.csv", "--out", out), "names no field")
    refused(twingap(file, "--bearing", "6999", *all_at_1800), "unknown bearing '6999'", "9,7.94,39.04,0")
    refused(twingap(file, "--channel", "B", *all_at_1800), "has no channel 'B'; it has Zeit, Beschl. A")
    refused(twingap(file, file, "--speed-rpm", 1, "--out", out), "several records would be called 'a'")
    noise = export(tmp_path / "n.csv", tacho=True)
    refused(twingap(noise, "--tacho-channel", "Beschl. A", "--out", out), "n.csv, channel Beschl. A", "irregular")
    rows = file.read_text("cp1252").splitlines()
    file.write_text("\n".join(rows[:900] + rows[950:]), encoding="cp1252")
    refused(twingap(file, "--speed-rpm", 1, "--out", out), "the time axis 'Zeit' is", "samples are missing")
    assert not out.exists()


@pytest.mark.parametrize(
    ("head", "step", "unit", "factor"), [("time_s,acc_g", 1.0, "g", 1.0), ("time_ms,acc_mg", 1e3, "g", 1e-3)]
)
def test_units_at_the_end_of_names(
    twingap: Run, tmp_path: Path, head: str, step: float, unit: str, factor: float
) -> None:
    table = np.column_stack([step * T, X])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="", fmt="%.7f")
    said = twingap(tmp_path / "a.csv", "--speed-rpm", 1500, "--out", tmp_path / "set")
    assert said.status == 0, said.err
    (record,) = read_record_set(tmp_path / "set")
    assert record.condition.fs_hz == FS
    assert read_record_set(tmp_path / "set").unit == unit
    np.testing.assert_allclose(record.samples, factor * X, rtol=1e-6)


def test_a_tacho_is_no_record(twingap: Run, tmp_path: Path) -> None:
    table = np.column_stack([T, X, TACHO])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="Time (s),acc (g),Tacho (V)", comments="", fmt="%.7f")
    said = twingap(tmp_path / "a.csv", "--speed-rpm", 1500, "--dry-run")
    assert "1 record understood" in said.out and "'Tacho (V)' is left out: give --tacho-channel" in said.out
    assert "Tacho" in twingap(tmp_path / "a.csv", "--speed-rpm", 1500, "--channel", "Tacho (V)", "--dry-run").out


def test_a_column_in_rpm_is_the_speed_where_nothing_else_states_it(twingap: Run, tmp_path: Path) -> None:
    table = np.column_stack([T, X, np.full(T.size, 1500.0)])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="time,acc [g],n [rpm]", comments="", fmt="%.7f")
    (record,) = json.loads(twingap(tmp_path / "a.csv", "--dry-run", "--json").out)["records"]
    assert record["speed_rpm"] == 1500 and record["speed from"] == "channel 'n [rpm]'"
    about = json.loads(twingap(tmp_path / "a.csv", "--speed-rpm", 1480, "--dry-run", "--json").out)
    (record,) = about["records"]
    assert record["speed_rpm"] == 1480 and any("give --speed-channel" in note for note in about["notes"])


def test_a_file_that_is_shorter_than_the_others_is_said(twingap: Run, tmp_path: Path) -> None:
    for name, count in (("a", T.size), ("b", T.size), ("c", T.size // 2)):
        table = np.column_stack([T, X])[:count]
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header="time,acc [g]", comments="", fmt="%.7f")
    said = twingap(tmp_path, "--speed-rpm", 1500, "--dry-run")
    assert "c.csv: " in said.out and "is the file whole?" in said.out and "a.csv: " not in said.out


def test_a_bearing_that_was_probably_meant_is_named(twingap: Run, tmp_path: Path) -> None:
    said = twingap(export(tmp_path / "a.csv"), "--speed-rpm", 1500, "--bearing", "6250", "--dry-run")
    assert said.status == 2 and "did you mean '6205'?" in said.err


def test_a_speed_channel_is_taken_where_it_is_and_else_the_name(twingap: Run, tmp_path: Path) -> None:
    table = np.column_stack([T, X, np.full(T.size, 1500.0)])
    np.savetxt(tmp_path / "ok_1480rpm.csv", table[:, :2], delimiter=",", header="time,acc [g]", comments="", fmt="%.7f")
    np.savetxt(
        tmp_path / "ok_1490rpm.csv", table, delimiter=",", header="time,acc [g],n [rpm]", comments="", fmt="%.7f"
    )
    words = ("--names", "{fault}_{speed_rpm:d}rpm.csv", "--speed-channel", "n [rpm]", "--dry-run", "--json")
    about = json.loads(twingap(tmp_path, *words).out)
    assert [record["speed_rpm"] for record in about["records"]] == [1480, 1500]
    assert any("the speed is that of the name" in note for note in about["notes"])
    for name in ("ok_1480rpm.csv", "ok_1490rpm.csv"):
        (tmp_path / name).rename(tmp_path / name.replace("ok_", "ok_1_"))
    assert "{fault}_{run}_" in twingap(tmp_path, *words).err


def test_records_of_few_turns_are_doubted(twingap: Run, tmp_path: Path) -> None:
    said = twingap(export(tmp_path / "outer_25rpm.csv"), "--names", "{fault}_{speed_rpm:d}rpm.csv", "--dry-run")
    assert said.status == 0 and "turns of the shaft" in said.out and "is the speed in rev/min?" in said.out
    said = twingap(export(tmp_path / "outer_250000rpm.csv"), "--names", "{fault}_{speed_rpm:d}rpm.csv", "--dry-run")
    assert said.status == 0 and "turns of the shaft" not in said.out


def test_a_group_of_several_faults_is_doubted(twingap: Run, tmp_path: Path) -> None:
    for fault in ("healthy", "outer"):
        for number in ("001", "002"):
            export(tmp_path / f"{fault}_{number}.csv")
    pattern = ("--speed-rpm", 1500, "--dry-run", "--names")
    said = twingap(tmp_path, *pattern, "{fault}_{group}.csv")
    assert "group '001' holds records of several faults (healthy, outer)" in said.out
    assert "several faults" not in twingap(tmp_path, *pattern, "{fault}_{number}.csv").out


def test_mixed_decimal_marks_are_named_where_they_hide_the_rate(twingap: Run, tmp_path: Path) -> None:
    file = export(tmp_path / "mixed.csv")
    lines = file.read_text(encoding="cp1252").splitlines()
    lines[3::2] = [line.replace(",", ".") for line in lines[3::2]]
    file.write_text("\n".join(lines) + "\n", encoding="cp1252")
    said = twingap(file, "--speed-rpm", 1500, "--out", tmp_path / "set")
    assert said.status == 2 and len(said.err.splitlines()) == 1
    assert "line 5, column Zeit: '0,000083' found, a number expected; write all of its numbers alike" in said.err


def test_what_cannot_be_written_is_not_shown_as_understood(twingap: Run, tmp_path: Path) -> None:
    file = export(tmp_path / "hole.csv")
    lines = file.read_text(encoding="cp1252").splitlines()
    lines[6] = lines[6].split(";")[0] + ";"
    file.write_text("\n".join(lines) + "\n", encoding="cp1252")
    said = twingap(file, "--speed-rpm", 1500, "--out", tmp_path / "set")
    assert said.status == 2 and said.out == "" and len(said.err.splitlines()) == 1 and not (tmp_path / "set").exists()
