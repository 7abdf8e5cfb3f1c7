"""`twingap rul` as it is typed."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.prognosis.simulated_runs import SimulatedRun, simulate_run
from twingap.records import Condition, Record
from twingap.records.folder import write_records

COLUMNS = [
    "record", "anomaly", "remaining_revolutions", "remaining_time_s", "remaining_time_s_lo", "remaining_time_s_hi",
]  # fmt: skip


@pytest.fixture
def twingap(typed: Run) -> Run:
    """Runs `twingap rul ...`."""
    return partial(typed, "rul")


def simulated(seed: int = 0, law: str = "exponential") -> SimulatedRun:
    return simulate_run(np.random.default_rng(seed), law, rows=60, varying=True)


def write(folder: Path, run: SimulatedRun) -> Path:
    """Its amplitudes as short records, in a folder whose name is not ASCII."""
    rng = np.random.default_rng(1)

    def records() -> list[Record]:
        made = []
        for row, (time_s, speed, p) in enumerate(zip(run.time_s, run.speed_rpm, run.peak_to_peak, strict=True)):
            x = rng.normal(size=256)
            condition = Condition(f"ä {row}", float(speed), 10000.0, 256, time_s=float(time_s), group="rig")
            made.append(Record(condition, x * p / np.ptp(x)))
        return made

    return write_records(folder / "Lauf, 1", "Lauf", "g", None, None, records())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("runs"), simulated())


def rows_of(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.reader(stream))


def edited(folder: Path, change: Callable[[list[list[str]]], list[list[str]]]) -> Path:
    """The same record set beside itself, with another records.csv."""
    copy = folder.with_name(f"{folder.name} {change.__name__}")
    copy.mkdir(exist_ok=True)
    (copy / "recordset.toml").write_text((folder / "recordset.toml").read_text("utf-8"), "utf-8")
    header, *rows = rows_of(folder / "records.csv")
    place = header.index("file")
    for row in rows:
        row[place] = f"../{folder.name}/{row[place]}"
    with (copy / "records.csv").open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows(change([header, *rows]))
    return copy


def test_columns_rows_and_what_is_said(twingap: Run, folder: Path, tmp_path: Path) -> None:
    run, out = simulated(), tmp_path / "neu" / "rül.csv"
    said = twingap(folder, "--out", out, "--limit-ratio", run.limit_ratio)
    assert said.status == 0 and said.out.splitlines()[-1] == str(out)
    assert "end of life is reached" in said.err and "own speed" in said.err and "false in 0.01" in said.err
    header, *rows = rows_of(out)
    assert header == COLUMNS and [row[0] for row in rows] == [f"ä {i}" for i in range(run.time_s.size)]
    alarmed = [row[1] for row in rows].index("1")
    assert run.onset_row <= alarmed and all(row[2:] == [""] * 4 for row in rows[:alarmed])
    for row, speed in zip(rows[alarmed:], run.speed_rpm[alarmed:], strict=True):
        revolutions, middle, low, high = map(float, row[2:])
        assert row[1] == "1" and 0 <= low <= middle <= high
        assert middle == pytest.approx(60 * revolutions / speed)
    assert float(rows[-1][2]) == 0


def test_a_row_uses_only_records_up_to_its_time_and_the_seed_changes_nothing(
    twingap: Run, folder: Path, tmp_path: Path
) -> None:
    count = simulated().time_s.size - 15

    def head(rows: list[list[str]]) -> list[list[str]]:
        return rows[: count + 1]

    def backwards(rows: list[list[str]]) -> list[list[str]]:
        return [rows[0], *rows[:0:-1]]

    for name, where, more in (
        ("whole", folder, ()), ("head", edited(folder, head), ("--seed", 7)), ("back", edited(folder, backwards), ()),
    ):  # fmt: skip
        said = twingap(where, "--out", tmp_path / f"{name}.csv", *more)
        assert said.status == 0
        assert ("not in order of time" in said.err) == (name == "back")
    whole = (tmp_path / "whole.csv").read_bytes()
    assert (tmp_path / "back.csv").read_bytes() == whole
    assert (tmp_path / "head.csv").read_bytes().splitlines() == whole.splitlines()[: count + 1]


def test_json(twingap: Run, folder: Path, tmp_path: Path) -> None:
    said = twingap(folder, "--out", tmp_path / "a.csv", "--json")
    about = json.loads(said.out)
    assert about["rows"] == len(about["records"]) == simulated().time_s.size
    assert list(about["records"][0]) == COLUMNS and about["records"][0]["remaining_time_s"] is None
    assert about["last"] == about["records"][-1] and about["alarm"].startswith("ä ") and about["notes"]
    assert said.err.splitlines()[-1] == str(tmp_path / "a.csv")


def test_stops_gaps_and_records_that_are_not_numbers_are_said(twingap: Run, folder: Path, tmp_path: Path) -> None:
    run = simulated()
    count = run.time_s.size
    np.save(folder.parent / "nan.npy", np.full(256, np.nan))
    np.save(folder.parent / "tiny.npy", 1e-100 * np.arange(256.0))

    def hurt(rows: list[list[str]]) -> list[list[str]]:
        header, *rest = rows
        speed, file = header.index("speed_rpm"), header.index("file")
        rest[count - 10][speed], rest[count - 10][file] = "0", ""
        rest[count - 8][file], rest[count - 7][file] = "../nan.npy", "../tiny.npy"
        return [header, *rest[:20], *rest[50:]]

    said = twingap(edited(folder, hurt), "--out", tmp_path / "a.csv", "--limit-ratio", run.limit_ratio)
    assert said.status == 0
    for part in ("stands still in 1 rows", "gap of", "left out", "nan.npy", "and 1 more"):
        assert part in said.err
    rows = {row[0]: row for row in rows_of(tmp_path / "a.csv")[1:]}
    still, unusable = rows[f"ä {count - 10}"], rows[f"ä {count - 8}"]
    assert still[1] == "1" and still[2] and still[3:] == ["", "", ""]
    assert unusable[1] == "1" and all(unusable[2:])


def test_a_single_record_and_healthy_rows_alone(twingap: Run, folder: Path, tmp_path: Path) -> None:
    def one(rows: list[list[str]]) -> list[list[str]]:
        return rows[:2]

    said = twingap(edited(folder, one), "--out", tmp_path / "a.csv")
    assert said.status == 0 and "too few" in said.err and "first 60 rows" in said.err

    header = rows_of(folder / "records.csv")[0]

    def at_last(rows: list[list[str]]) -> list[list[str]]:
        rows[-1][header.index("time_s")] = "1e300"
        return rows

    refused(twingap(edited(folder, at_last), "--out", tmp_path / "b.csv"), "time_s spans 1e+300 s", "seconds")
    assert rows_of(tmp_path / "a.csv")[1] == ["ä 0", "0", "", "", "", ""]


def test_why_there_is_no_anomaly(twingap: Run, tmp_path: Path) -> None:
    """A machine that hardly ran is not one with many rows, and the last rows of one that breaks are not healthy."""
    rng = np.random.default_rng(0)

    def said(name: str, heights: np.ndarray, speeds: np.ndarray) -> str:
        made = [
            Record(Condition(f"{k}", float(s), 10000.0, 64, time_s=60.0 * k), h * rng.normal(size=64))
            for k, (h, s) in enumerate(zip(heights, speeds, strict=True))
        ]
        folder = write_records(tmp_path / name, name, "g", None, None, made)
        table = (folder / "records.csv").read_text("utf-8").replace(",1.0,", ",0,")
        (folder / "records.csv").write_text(table, "utf-8")
        found = twingap(folder, "--out", tmp_path / "a.csv")
        assert found.status == 0
        return found.err

    speeds = np.full(120, 1500.0)
    assert "120 rows" not in said("still", np.ones(120), np.where(np.arange(120) < 119, 1.0, 1500.0))
    assert "does not stay above its healthy scatter" in said("healthy", np.ones(120), speeds)
    assert "the last 3 rows lie above" in said("breaks", np.where(np.arange(120) < 117, 1.0, 50.0), speeds)


def test_rows_that_cannot_be_judged_name_their_run(twingap: Run, folder: Path, tmp_path: Path) -> None:
    x = np.random.default_rng(0).normal(size=64)
    equal = [Record(Condition(f"{k}", 1500.0, 10000.0, 64, time_s=60.0 * k), x) for k in range(70)]
    other = write_records(tmp_path / "other", "the other", "g", None, None, equal)
    refused(twingap(folder, "--out", tmp_path / "a.csv", "--prior", other), "run 'the other'", "all rows are equal")
    refused(twingap(folder, "--out", tmp_path / "a.csv", "--limit", "1e-12"), "run 'Lauf'", "rpm", "raise the limit")


def test_other_runs_fill_the_rows_before_the_anomaly(twingap: Run, folder: Path, tmp_path: Path) -> None:
    other = write(tmp_path, simulated(5, "bent"))
    table = tmp_path / "runs.csv"
    table.write_text("record,life_revolutions,after_anomaly_revolutions,end_ratio\na,200000,,\nb,3e5,1e5,9\n", "utf-8")
    said = twingap(folder, "--out", tmp_path / "a.csv", "--prior", other, "--prior", table)
    assert said.status == 0 and "--prior ended at" in said.err
    assert "times as wide, in logarithms, as they are without --prior" in said.err
    assert "growth counts 0.75, lives of other runs 0.25" in said.err
    for row in rows_of(tmp_path / "a.csv")[1:]:
        low, high = float(row[4]), float(row[5])
        assert low <= float(row[3]) <= high


def no_time(rows: list[list[str]]) -> list[list[str]]:
    place = rows[0].index("time_s")
    return [[*row[:place], *row[place + 1 :]] for row in rows]


def empty_time(rows: list[list[str]]) -> list[list[str]]:
    rows[3][rows[0].index("time_s")] = ""
    return rows


def two_bearings(rows: list[list[str]]) -> list[list[str]]:
    for number, row in enumerate(rows[1:]):
        row[rows[0].index("group")] = "ab"[number % 2]
    return rows


def no_file(rows: list[list[str]]) -> list[list[str]]:
    rows[5][rows[0].index("file")] = "gone.npy"
    return rows


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (no_time, ("'time_s' is missing",)), (empty_time, ("row 4, column time_s", "fill it in")),
        (two_bearings, ("a, b", "--group")), (no_file, ("row 6, column file", "no such file")),
    ],
)  # fmt: skip
def test_what_is_no_run_is_refused_in_a_line(
    twingap: Run, folder: Path, tmp_path: Path, change: Callable[..., list[list[str]]], parts: tuple[str, ...]
) -> None:
    refused(twingap(edited(folder, change), "--out", tmp_path / "a.csv"), *parts)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ('[recordset]\nunit = "m/s2"\n', ("unit = 'm/s2'", "m/s^2")),
        ("[recordset]\nunit = 5\n", ("unit: 5", "string")),
        ("[recordset]\nrate = 5\n", ("'rate'",)), ("[recordset]\nfs_hz = 0\n", ("fs_hz = 0",)), ("", ("recordset",)),
        ('[recordset]\n[bearing]\nname = "x"\n', ("bearing", "n_rollers")),
    ],
)  # fmt: skip
def test_a_description_that_is_wrong_is_refused_in_a_line(
    twingap: Run, folder: Path, tmp_path: Path, text: str, parts: tuple[str, ...]
) -> None:
    def described(rows: list[list[str]]) -> list[list[str]]:
        return rows

    copy = edited(folder, described)
    (copy / "recordset.toml").write_text(text, "utf-8")
    refused(twingap(copy, "--out", tmp_path / "a.csv"), "recordset.toml", *parts)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--limit-ratio", "1"), ("--limit-ratio",)), (("--limit", "1e-12"), ("raise the limit",)),
        (("--group", "b"), ("'b'", "rig")), (("--prior", "nowhere"), ("nowhere", "no such run")),
        (("--gaps", "perhaps"), ("perhaps",)), (("--limit", "inf"), ("--limit", "limit = inf, a positive amplitude")),
    ],
)  # fmt: skip
def test_impossible_options_are_refused_in_a_line(
    twingap: Run, folder: Path, tmp_path: Path, options: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    refused(twingap(folder, "--out", tmp_path / "a.csv", *options), *parts)
    assert list(tmp_path.iterdir()) == []


def test_what_is_read_is_not_written_over(twingap: Run, folder: Path, tmp_path: Path) -> None:
    table = tmp_path / "runs.csv"
    table.write_text("record,life_revolutions\na,200000\n", "utf-8")
    for out in (folder / "records.csv", folder / "recordset.toml", table):
        before = out.read_bytes()
        refused(twingap(folder, "--out", out, "--prior", table), out.name, "name another file")
        assert out.read_bytes() == before


def test_the_bearings_of_a_set_are_told_apart_by_group(twingap: Run, folder: Path, tmp_path: Path) -> None:
    both = edited(folder, two_bearings)
    refused(
        twingap(both, "--out", tmp_path / "a.csv", "--group", "a", "--prior", both), "a, b", "a record set of its own"
    )
    said = twingap(both, "--out", tmp_path / "a.csv", "--group", "a")
    assert said.status == 0 and len(rows_of(tmp_path / "a.csv")) == 1 + (simulated().time_s.size + 1) // 2
