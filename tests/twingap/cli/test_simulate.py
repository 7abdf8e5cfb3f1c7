"""`twingap simulate` as it is typed."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from tests.twingap.cli.typed import Run, Said, refused
from twingap.bearing import BEARINGS
from twingap.records.folder import read_record_set
from twingap.twins.twin_file import Provenance, TwinSpec, write_twin


@pytest.fixture
def twingap(typed: Run) -> Run:
    """Runs `twingap ...`."""
    return typed


@pytest.fixture
def twin(tmp_path: Path) -> Path:
    path = tmp_path / "mein Zwilling.toml"
    write_twin(path, TwinSpec("phenomenological", ("slip_jitter",), bearing=BEARINGS["6205"]))
    return path


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "Zustände für morgen.csv"
    rows = [f"{f}{i},{1500 + 100 * i},{f},{10 * i},{f[0]}" for f in ("healthy", "inner") for i in range(3)]
    path.write_text("record,speed_rpm,fault,time_s,rig\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def simulate(twingap: Run, twin: Path, table: Path, out: Path, *more: object) -> Said:
    return twingap("simulate", twin, "--records", table, "--out", out, "--fs-hz", 12000, "--duration-s", 0.1, *more)


def test_a_table_becomes_a_record_set(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    out = tmp_path / "neue Sätze" / "a"
    said = simulate(twingap, twin, table, out)
    assert said.status == 0 and said.err == ""
    assert said.out.splitlines()[-1] == str(out)
    made = read_record_set(out)
    assert len(made) == 6 and made.bearing == BEARINGS["6205"] and made.unit == "m/s^2"
    assert made.conditions[4].fault == "inner" and made.conditions[4].speed_rpm == 1600
    assert made.conditions[4].time_s == 10 and made.conditions[4].extra["rig"] == "i"
    assert all(r.samples.shape == (1200,) and np.isfinite(r.samples).all() for r in made)
    assert sorted(p.name for p in out.parent.iterdir()) == ["a"]


def test_samples_are_not_held_however_many_records_there_are(twingap: Run, twin: Path, tmp_path: Path) -> None:
    """What grows is the table of conditions and of files, a few kilobytes a record; samples are 16 kB each."""
    peaks = []
    for records in (20, 500, 2000):  # the first imports and compiles
        path = tmp_path / f"{records}.csv"
        rows = [f"r{i},{900 + i % 1500},{('healthy', 'outer')[i % 2]}" for i in range(records)]
        path.write_text("\n".join(["record,speed_rpm,fault", *rows]) + "\n", encoding="utf-8")
        words = ("--fs-hz", 8000, "--duration-s", 0.25, "--out", tmp_path / f"{records}")
        tracemalloc.start()
        try:
            assert twingap("simulate", twin, "--records", path, *words).status == 0
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[2] - peaks[1] < 1500 * 5000


def test_same_seed_same_bytes(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        assert simulate(twingap, twin, table, tmp_path / name, "--seed", seed).status == 0
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) == 8
    assert all((tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes() for f in files)
    assert any((tmp_path / "a" / f).read_bytes() != (tmp_path / "c" / f).read_bytes() for f in files)


def test_a_record_set_gives_conditions_bearing_and_unit(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    simulate(twingap, twin, table, tmp_path / "a")
    again = TwinSpec("phenomenological", bearing=BEARINGS["6203"], identified=Provenance(unit="g"))
    write_twin(tmp_path / "identified.toml", again)
    said = twingap(
        "simulate", tmp_path / "identified.toml", "--records", tmp_path / "a", "--out", tmp_path / "b", "--json"
    )
    assert said.status == 0
    about = json.loads(said.out)
    assert about["records"] == 6 and about["unit"] == "g" and about["out"] == str(tmp_path / "b")
    one, two = read_record_set(tmp_path / "a"), read_record_set(tmp_path / "b")
    assert two.conditions == one.conditions
    assert two.bearing == BEARINGS["6205"] and two.unit == "g"  # the records' bearing, the twin's unit


def test_another_bearing_than_the_record_sets_is_said(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    said = simulate(twingap, twin, table, tmp_path / "a")
    assert said.status == 0 and "note:" not in said.out
    other = tmp_path / "other.toml"
    write_twin(other, TwinSpec("phenomenological", bearing=BEARINGS["6203"]))
    said = twingap("simulate", other, "--records", tmp_path / "a", "--out", tmp_path / "b")
    assert said.status == 0, said.err
    notes = [line for line in said.out.splitlines() if line.startswith("note: ")]
    assert len(notes) == 1 and "the twin file's bearing (8 rollers" in notes[0] and "the records' is used" in notes[0]
    said = twingap("simulate", other, "--records", tmp_path / "a", "--out", tmp_path / "c", "--json")
    assert [f"note: {note}" for note in json.loads(said.out)["notes"]] == notes
    said = twingap("simulate", twin, "--records", tmp_path / "a", "--out", tmp_path / "d", "--json")
    assert json.loads(said.out)["notes"] == []
    assert read_record_set(tmp_path / "b").bearing == BEARINGS["6205"]


@pytest.mark.parametrize("inside", ["", "records.csv", "recordset.toml"])
def test_the_unit_is_the_record_sets_however_it_is_named(
    twingap: Run, twin: Path, table: Path, tmp_path: Path, inside: str
) -> None:
    assert simulate(twingap, twin, table, tmp_path / "a").status == 0
    about = tmp_path / "a" / "recordset.toml"
    about.write_text(about.read_text(encoding="utf-8").replace('"m/s^2"', '""'), encoding="utf-8")
    said = twingap("simulate", twin, "--records", tmp_path / "a" / inside, "--out", tmp_path / "b")
    assert said.status == 0, said.err
    assert read_record_set(tmp_path / "b").unit == ""


def test_a_speed_of_another_unit_is_refused_before_memory_runs_out(twingap: Run, twin: Path, tmp_path: Path) -> None:
    table = tmp_path / "fast.csv"
    table.write_text("record,speed_rpm,fault\na,1e12,inner\n", encoding="utf-8")
    refused(simulate(twingap, twin, table, tmp_path / "out"), "'a'", "turns 1.39e+06 times per sample", "speed_rpm")
    assert not (tmp_path / "out").exists()


def test_a_record_set_takes_no_rate_or_length(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    assert simulate(twingap, twin, table, tmp_path / "a").status == 0
    refused(simulate(twingap, twin, tmp_path / "a", tmp_path / "b"), "--fs-hz and --duration-s", "of their own")
    assert not (tmp_path / "b").exists()


def test_contact_twin(twingap: Run, table: Path, tmp_path: Path) -> None:
    write_twin(tmp_path / "c.toml", TwinSpec("contact", (), "physical", bearing=BEARINGS["6205"]))
    assert simulate(twingap, tmp_path / "c.toml", table, tmp_path / "out").status == 0
    assert len(read_record_set(tmp_path / "out")) == 6


@pytest.mark.parametrize(("unit", "factor"), [("g", 9.80665), ("", 1.0), ("m/s^2", 1.0)])
def test_a_contact_twin_without_a_scale_makes_samples_in_the_record_sets_unit(
    twingap: Run, table: Path, tmp_path: Path, unit: str, factor: float
) -> None:
    own = tmp_path / "c.toml"
    write_twin(own, TwinSpec("contact", (), "physical", bearing=BEARINGS["6205"]))
    said = simulate(twingap, own, table, tmp_path / "a")
    assert said.status == 0 and said.err == ""  # a table states no unit: m/s^2, which needs no word
    about = tmp_path / "a" / "recordset.toml"
    about.write_text(about.read_text(encoding="utf-8").replace('"m/s^2"', f'"{unit}"'), encoding="utf-8")
    said = twingap("simulate", own, "--records", tmp_path / "a", "--out", tmp_path / "b", "--json")
    assert said.status == 0, said.err
    plain, made = read_record_set(tmp_path / "a"), read_record_set(tmp_path / "b")
    assert made.unit == unit
    assert all(np.allclose(x.samples, factor * y.samples, rtol=1e-4) for x, y in zip(plain, made, strict=True))
    notes = [line.removeprefix("note: ") for line in said.err.splitlines() if line.startswith("note: ")]
    assert notes == json.loads(said.out)["notes"] and len(notes) == (unit != "m/s^2")
    assert {"g": "0.102 leads", "": "are in m/s^2", "m/s^2": ""}[unit] in "".join(notes)


def test_mistakes_are_one_line_and_leave_nothing(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    no_bearing = tmp_path / "no bearing.toml"
    write_twin(no_bearing, TwinSpec("phenomenological"))
    unknown = tmp_path / "unknown.csv"
    unknown.write_text("record,speed_rpm,fault\na,1797,healthy\nb,1797,\n")
    before = sorted(tmp_path.iterdir())
    refused(simulate(twingap, tmp_path / "nowhere.toml", table, out), "nowhere.toml")
    refused(simulate(twingap, twin, tmp_path / "nowhere.csv", out), "nowhere.csv")
    refused(simulate(twingap, table, table, out), table.name)
    refused(simulate(twingap, no_bearing, table, out), "no bearing.toml", "[bearing]")
    refused(simulate(twingap, twin, unknown, out), "unknown.csv", "'b'", "fault")
    refused(twingap("simulate", twin, "--records", table, "--out", out), "fs_hz")
    refused(twingap("simulate", twin, "--records", table, "--out", out, "--fs-hz", 12000), "n_samples or duration_s")
    refused(simulate(twingap, twin, table, out, "--fs-hz", -5), "twingap: --fs-hz: -5")
    refused(simulate(twingap, twin, table, out, "--fs-hz", "nan"), "twingap: --fs-hz: nan")
    refused(simulate(twingap, twin, table, out, "--duration-s", -1), "twingap: --duration-s: -1")
    refused(
        twingap("simulate", twin, "--records", table, "--out", out, "--fs-hz", 4000, "--duration-s", 1), "resonance"
    )
    assert sorted(tmp_path.iterdir()) == before


def test_what_exists_is_not_overwritten(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    out = tmp_path / "full"
    out.mkdir()
    (out / "mine.txt").write_text("keep")
    refused(simulate(twingap, twin, table, out), "full", "not an empty folder")
    assert [p.name for p in out.iterdir()] == ["mine.txt"]
    refused(simulate(twingap, twin, table, twin), twin.name)
    refused(simulate(twingap, twin, table, Path("/proc/nothing/here")), "/proc/nothing")


@pytest.mark.parametrize(
    "wrong", [b"", b"record,speed_rpm\n", b"\xff\xfe\x00", b"record,speed_rpm,fault\na,fast,inner\n"]
)
def test_tables_that_are_none(twingap: Run, twin: Path, tmp_path: Path, wrong: bytes) -> None:
    path = tmp_path / "wrong.csv"
    path.write_bytes(wrong)
    refused(simulate(twingap, twin, path, tmp_path / "out"), "wrong.csv")
    assert not (tmp_path / "out").exists()


def test_a_population_has_a_record_per_machine_and_condition(
    twingap: Run, twin: Path, table: Path, tmp_path: Path
) -> None:
    units = {unit: {"sigma": sigma} for unit, sigma in (("a", 0.1), ("b", 0.3))}
    spec = TwinSpec(
        "phenomenological", ("impact_scatter",), parameters={"impact_scatter": {"inner": {"units": units}}},
        bearing=BEARINGS["6205"],
    )  # fmt: skip
    write_twin(tmp_path / "closest.toml", spec)
    said = simulate(twingap, tmp_path / "closest.toml", table, tmp_path / "set", "--population", 4)
    assert said.status == 0 and "24 records" in said.out
    made = read_record_set(tmp_path / "set")
    assert [c.name for c in made.conditions[::6]] == [f"machine{i}_healthy0" for i in (1, 2, 3, 4)]
    assert made.conditions[6].extra["unit"] == "machine2"
    said = simulate(twingap, twin, table, tmp_path / "none", "--population", 4)
    refused(said, "no values of several units", "bearing_id")
    assert not (tmp_path / "none").exists()


def test_impacts_that_were_never_identified_are_noted(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    spec = TwinSpec(
        "phenomenological", parameters={"impact_amplitude": {"outer": 4.0}}, bearing=BEARINGS["6205"],
        identified=Provenance(unit="g"),
    )  # fmt: skip
    write_twin(tmp_path / "closest.toml", spec)
    said = simulate(twingap, tmp_path / "closest.toml", table, tmp_path / "a")
    assert said.status == 0 and "not identified with faults of inner: their impacts have default" in said.out
    assert "default" not in simulate(twingap, twin, table, tmp_path / "b").out


def test_a_device_that_the_twin_cannot_use_is_refused(twingap: Run, twin: Path, table: Path, tmp_path: Path) -> None:
    refused(simulate(twingap, twin, table, tmp_path / "out", "--device", "cuda"), "only the integration of the contact")
    assert not (tmp_path / "out").exists()
