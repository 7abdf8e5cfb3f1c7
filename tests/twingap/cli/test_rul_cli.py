"""`twingap rul` as it is typed."""

from __future__ import annotations

import csv
import json
import zlib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

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


def write(folder: Path, run: SimulatedRun, unit: str = "g", scale: float = 1.0) -> Path:
    """Its amplitudes as short records, in a folder whose name is not ASCII."""
    rng = np.random.default_rng(1)

    def records() -> list[Record]:
        made = []
        for row, (time_s, speed, p) in enumerate(zip(run.time_s, run.speed_rpm, run.peak_to_peak, strict=True)):
            x = rng.normal(size=256)
            condition = Condition(f"ä {row}", float(speed), 10000.0, 256, time_s=float(time_s), group="rig")
            made.append(Record(condition, scale * (x * p / np.ptp(x))))
        return made

    return write_records(folder / "Lauf, 1", "Lauf", unit, None, None, records())


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
    done = twingap(folder, "--out", out, "--limit-ratio", run.limit_ratio)
    assert done.status == 0 and done.out.splitlines()[-1] == str(out)
    assert "end of life is reached" in done.err and "speed of each row" in done.err and "false in 0.01" in done.err
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
        done = twingap(where, "--out", tmp_path / f"{name}.csv", *more)
        assert done.status == 0
        assert ("not in order of time" in done.err) == (name == "back")
    whole = (tmp_path / "whole.csv").read_bytes()
    assert (tmp_path / "back.csv").read_bytes() == whole
    assert (tmp_path / "head.csv").read_bytes().splitlines() == whole.splitlines()[: count + 1]


def test_json(twingap: Run, folder: Path, tmp_path: Path) -> None:
    done = twingap(folder, "--out", tmp_path / "a.csv", "--json")
    about = json.loads(done.out)
    assert about["rows"] == len(about["records"]) == simulated().time_s.size
    assert list(about["records"][0]) == COLUMNS and about["records"][0]["remaining_time_s"] is None
    assert about["last"] == about["records"][-1] and about["alarm"].startswith("ä ") and about["notes"]
    assert done.err.splitlines()[-1] == str(tmp_path / "a.csv")


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

    done = twingap(edited(folder, hurt), "--out", tmp_path / "a.csv", "--limit-ratio", run.limit_ratio)
    assert done.status == 0
    for part in ("stands still in 1 rows", "gap of", "left out", "nan.npy", "and 1 more"):
        assert part in done.err
    rows = {row[0]: row for row in rows_of(tmp_path / "a.csv")[1:]}
    still, unusable = rows[f"ä {count - 10}"], rows[f"ä {count - 8}"]
    assert still[1] == "1" and still[2] and still[3:] == ["", "", ""]
    assert unusable[1] == "1" and all(unusable[2:])


def test_a_run_that_begins_damaged_is_said_and_has_no_lower_end(twingap: Run, tmp_path: Path) -> None:
    """At varying speed, where S takes up what grows within the first rows; a --limit needs no note."""
    whole = simulate_run(np.random.default_rng([74, zlib.crc32(b"exponential")]), "exponential", rows=400, varying=True)
    first = (whole.onset_row + whole.time_s.size) // 2
    run = replace(
        whole, time_s=whole.time_s[first:], speed_rpm=whole.speed_rpm[first:], peak_to_peak=whole.peak_to_peak[first:]
    )
    late, out = write(tmp_path, run), tmp_path / "a.csv"
    healthy = twingap(write(tmp_path / "whole", whole), "--out", out, "--limit-ratio", whole.limit_ratio)
    assert (
        "may not have been healthy" not in healthy.err and "earlier than estimated if they were damaged" in healthy.err
    )
    done = twingap(late, "--out", out, "--limit-ratio", whole.limit_ratio)
    assert done.status == 0 and "the start may not have been healthy" in done.err and "lower end" in done.err
    rows = [row for row in rows_of(out)[1:] if row[1] == "1"]
    assert len(rows) > 20 and all(float(row[4]) == 0 <= float(row[3]) <= float(row[5]) for row in rows)
    limited = twingap(late, "--out", out, "--limit", 1.01 * float(whole.peak_to_peak.max()))
    assert "healthy start" not in limited.err and "shown to be healthy" not in limited.err
    assert any(float(row[4]) > 0 for row in rows_of(out)[1:] if row[1] == "1")


def test_a_single_record_and_healthy_rows_alone(twingap: Run, folder: Path, tmp_path: Path) -> None:
    def one(rows: list[list[str]]) -> list[list[str]]:
        return rows[:2]

    done = twingap(edited(folder, one), "--out", tmp_path / "a.csv")
    assert done.status == 0 and "too few" in done.err and "first 60 rows" in done.err

    header = rows_of(folder / "records.csv")[0]

    def at_last(rows: list[list[str]]) -> list[list[str]]:
        rows[-1][header.index("time_s")] = "1e300"
        return rows

    refused(twingap(edited(folder, at_last), "--out", tmp_path / "b.csv"), "time_s spans 1e+300 s", "seconds")
    assert rows_of(tmp_path / "a.csv")[1] == ["ä 0", "0", "", "", "", ""]


def test_a_run_no_longer_than_its_healthy_rows_says_why_no_row_has_an_estimate(
    twingap: Run, folder: Path, tmp_path: Path
) -> None:
    def short(rows: list[list[str]]) -> list[list[str]]:
        return rows[:41]

    run, out = edited(folder, short), tmp_path / "a.csv"
    note = "no row has an estimate: the run has 40 rows, and the first {} are taken as healthy; give a smaller"
    for rows, words in ((60, ()), (40, ("--healthy-rows", 40))):
        done = twingap(run, "--out", out, *words)
        assert done.status == 0 and done.err.splitlines()[0] == f"note: {note.format(rows)} --healthy-rows"
        assert all(row[1:] == ["0", "", "", "", ""] for row in rows_of(out)[1:])
    assert "no row has an estimate" not in twingap(run, "--out", out, "--healthy-rows", 20).err
    table = tmp_path / "runs.csv"
    table.write_text("record,life_revolutions\na,200000\nb,3e5\n", "utf-8")
    assert "no row has an estimate" not in twingap(run, "--out", out, "--prior", table).err
    assert all(all(row) for row in rows_of(out)[1:]), "the other runs give estimates"


def test_why_there_is_no_anomaly(twingap: Run, tmp_path: Path) -> None:
    """A machine that hardly ran is not one with many rows, and the last rows of one that breaks are not healthy."""
    rng = np.random.default_rng(0)

    def done(name: str, heights: np.ndarray, speeds: np.ndarray) -> str:
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
    assert "120 rows" not in done("still", np.ones(120), np.where(np.arange(120) < 119, 1.0, 1500.0))
    assert "does not stay above its healthy scatter" in done("healthy", np.ones(120), speeds)
    assert "the last 3 rows are above" in done("breaks", np.where(np.arange(120) < 117, 1.0, 50.0), speeds)


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
    done = twingap(folder, "--out", tmp_path / "a.csv", "--prior", other, "--prior", table)
    assert done.status == 0 and "the other runs ended at" in done.err
    assert "times as wide, in logarithms, as without other runs" in done.err
    assert "pooled with growth of weight 0.75" in done.err
    for row in rows_of(tmp_path / "a.csv")[1:]:
        low, high = float(row[4]), float(row[5])
        assert low <= float(row[3]) <= high


def test_other_groups_of_the_set_are_a_prior_by_default(twingap: Run, tmp_path: Path) -> None:
    """Those that end with an anomaly, at their loads; one that is still healthy is none."""
    rng = np.random.default_rng(1)

    def records() -> list[Record]:
        made = []
        for place, (law, load_n) in enumerate((("bent", 1000.0), ("exponential", 1000.0), ("power", 2000.0))):
            run = simulate_run(np.random.default_rng(place), law, rows=60, varying=False)
            for row, (time_s, speed, p) in enumerate(zip(run.time_s, run.speed_rpm, run.peak_to_peak, strict=True)):
                if place == 1 and row == run.onset_row:
                    break
                x = rng.normal(size=256)
                condition = Condition(
                    f"{place} {row}", float(speed), 1e4, 256, time_s=float(time_s), load_n=load_n, group=law
                )
                made.append(Record(condition, x * p / np.ptp(x)))
        return made

    rig = write_records(tmp_path / "rig", "rig", "g", None, None, records())
    done = twingap(rig, "--group", "bent", "--out", tmp_path / "a.csv", "--healthy-rows", 30)
    assert done.status == 0 and all(all(row[2:]) for row in rows_of(tmp_path / "a.csv")[1:])
    assert "groups 'power' end with an anomaly" in done.err and "converted to 1000 N" in done.err
    assert "no ended runs and not used: 'exponential'" in done.err
    alone = twingap(rig, "--group", "bent", "--out", tmp_path / "b.csv", "--healthy-rows", 30, "--alone")
    assert "end with an anomaly" not in alone.err and rows_of(tmp_path / "b.csv")[1][2:] == [""] * 4


def test_the_limit_is_converted_to_the_unit_of_other_runs(twingap: Run, folder: Path, tmp_path: Path) -> None:
    """15 g are no 15 m/s^2: the same run says the same in either unit, and an unknown one is refused."""
    run, other = simulated(), simulated(5, "bent")
    limit = 0.7 * float(min(run.peak_to_peak.max(), other.peak_to_peak.max()))
    g = write(tmp_path / "g", other)
    si = write(tmp_path / "si", other, "m/s^2", 9.80665)
    unknown = write(tmp_path / "unknown", other, "")
    ask = ("--limit", limit)
    one = twingap(folder, "--out", tmp_path / "g.csv", *ask, "--prior", g)
    two = twingap(folder, "--out", tmp_path / "si.csv", *ask, "--prior", si)
    assert one.status == two.status == 0
    assert f"{9.80665 * limit:.4g} m/s^2 in the records of {si}" in two.err and "m/s^2" not in one.err
    for a, b in zip(rows_of(tmp_path / "g.csv")[1:], rows_of(tmp_path / "si.csv")[1:], strict=True):
        assert a[:2] == b[:2]
        assert [float(v) for v in a[2:] if v] == pytest.approx([float(v) for v in b[2:] if v], rel=1e-6)
    refused(twingap(folder, "--out", tmp_path / "no.csv", *ask, "--prior", unknown), str(unknown), "state the unit")
    done = twingap(folder, "--out", tmp_path / "ratio.csv", "--prior", unknown)  # a ratio has no unit
    assert done.status == 0
    done = twingap(unknown, "--out", tmp_path / "both.csv", *ask, "--prior", write(tmp_path / "too", run, ""))
    assert done.status == 0 and "units are unknown" in done.err


def test_a_run_is_not_told_its_own_future(twingap: Run, folder: Path, tmp_path: Path) -> None:
    def copied(rows: list[list[str]]) -> list[list[str]]:
        place = rows[0].index("record")
        return [rows[0], *([*row[:place], f"other {row[place]}", *row[place + 1 :]] for row in rows[1:])]

    def begun(rows: list[list[str]]) -> list[list[str]]:
        return rows[:40]

    run, part = simulated(), edited(folder, begun)
    out = tmp_path / "a.csv"
    refused(twingap(folder, "--out", out, "--prior", folder / "."), "would enter the estimate")
    refused(twingap(folder, "--out", out, "--prior", edited(folder, copied)), "copied", "would enter the estimate")
    refused(
        twingap(part, "--out", out, "--prior", folder), "would enter the estimate"
    )  # as known so far, and as it ended
    refused(
        twingap(folder, "--out", out, "--prior", write(tmp_path / "si", run, "m/s^2", 9.80665)),
        "would enter the estimate",
    )
    assert not out.exists()


def test_a_run_counts_once_among_others(twingap: Run, folder: Path, tmp_path: Path) -> None:
    other = simulated(5, "bent")
    first, again = write(tmp_path / "first", other), write(tmp_path / "again", other)
    table = tmp_path / "runs.csv"
    table.write_text("record,life_revolutions\na,200000\nb,200000\n", "utf-8")
    out = tmp_path / "a.csv"
    for twice in ((first, first), (first, again), (table, first, table)):
        given = [part for path in twice for part in ("--prior", path)]
        refused(twingap(folder, "--out", out, *given), str(twice[-1]), "already given", "once")
    assert not out.exists()
    assert twingap(folder, "--out", out, "--prior", table, "--prior", first).status == 0


def of_lengths(folder: Path, lengths: list[int], growth: float = 1.0) -> Path:
    """Noise in records of these lengths, louder by a factor from the last third on."""
    rng = np.random.default_rng(9)
    made = [
        Record(
            Condition(f"r{k}", 1500.0, 5000.0, n, time_s=600.0 * k),
            rng.normal(size=n) * (growth if 3 * k > 2 * len(lengths) else 1.0),
        )
        for k, n in enumerate(lengths)
    ]
    return write_records(folder, "noise", "g", None, None, made)


def test_longer_records_of_the_same_noise_are_no_anomaly(twingap: Run, tmp_path: Path) -> None:
    """Peak to peak of noise grows with length; what is found must come from the machine."""

    def alarm(name: str, lengths: list[int], growth: float = 1.0) -> tuple[str | None, str]:
        folder = of_lengths(tmp_path / name, lengths, growth)
        done = twingap(folder, "--out", tmp_path / f"{name}.csv", "--json")
        assert done.status == 0
        about = json.loads(done.out)
        return about["alarm"], "; ".join(about["notes"])

    found, notes = alarm("longer", [500] * 100 + [20000] * 60)
    assert found is None and "500 to 20000 samples" in notes and "first 500 of each" in notes
    assert alarm("louder", [500] * 100 + [20000] * 60, 3.0)[0] is not None
    assert alarm("mixed", [500, 3000] * 80)[0] is None
    found, notes = alarm("cut off", [500] * 30 + [7] + [500] * 69 + [530] * 60, 3.0)
    assert found is not None and "record 'r30' has too few samples" in notes  # and is not what all are judged by
    found, notes = alarm("shorter", [5000] * 100 + [500] * 60, 3.0)
    assert found is None and "60 records, the first 'r100', have too few samples" in notes
    assert "samples" not in alarm("equal", [500] * 160)[1]


def test_how_much_of_a_record_is_taken_depends_on_no_later_one(twingap: Run, tmp_path: Path) -> None:
    lengths = [600] * 40 + [500] * 60 + [20000] * 40 + [550] * 20
    whole, head = of_lengths(tmp_path / "whole", lengths, 3.0), tmp_path / "head"
    for name, rows in (("head", 130), ("start", 50)):
        head = of_lengths(tmp_path / name, lengths, 3.0)
        table = (head / "records.csv").read_text("utf-8").splitlines(keepends=True)
        (head / "records.csv").write_text("".join(table[: rows + 1]), "utf-8")
        for folder in (whole, head):
            assert twingap(folder, "--out", tmp_path / f"{folder.name}.csv").status == 0
        lines = [(tmp_path / f"{folder.name}.csv").read_bytes().splitlines() for folder in (whole, head)]
        assert lines[1] == lines[0][: rows + 1]


def test_the_limit_among_the_healthy_rows_is_reached_whatever_is_recorded_later(twingap: Run, tmp_path: Path) -> None:
    """Row 20 reaches it as a whole, and not with its first 1200 samples, which is all that row 40 would leave of it."""
    made = []
    for row in range(60):
        x = 0.1 * np.random.default_rng(row).normal(size=1200 if row == 40 else 2000)
        if row == 20:
            x[1500:1504] = 30.0, -30.0, 20.0, -10.0
        made.append(Record(Condition(f"r{row}", 1500.0, 5000.0, x.size, time_s=600.0 * row), x))
    done = []
    for rows in (60, 30):
        folder = write_records(tmp_path / f"{rows}", "noise", "g", None, None, made[:rows])
        assert twingap(folder, "--out", tmp_path / f"{rows}.csv", "--limit", 15).status == 0
        done.append((tmp_path / f"{rows}.csv").read_bytes().splitlines())
    assert done[1] == done[0][:31] and done[0][21].startswith(b"r20,1,0") and done[0][20].startswith(b"r19,0,")


def test_groups_that_follow_one_another_are_said_to_be_taken_for_one_run(twingap: Run, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    made = [
        Record(
            Condition(f"r{row}", 1500.0, 5000.0, 256, time_s=600.0 * row, group="AB"[row // 40]), rng.normal(size=256)
        )
        for row in range(80)
    ]
    folder = write_records(tmp_path / "two", "noise", "g", None, None, made)
    done = twingap(folder, "--out", tmp_path / "a.csv")
    assert done.status == 0 and "2 groups that follow one another in time (A, B): assumed to be recordings" in done.err
    done = twingap(folder, "--out", tmp_path / "b.csv", "--group", "A")
    assert done.status == 0 and "groups" not in done.err


def test_a_prior_run_recorded_beyond_the_limit_ended_there(twingap: Run, folder: Path, tmp_path: Path) -> None:
    """Rows after the end do not enter the prior, and a note names the end."""
    run = simulated(3)
    limit = 25.0
    first = int(np.flatnonzero(run.peak_to_peak >= limit)[0])
    answers = []
    for rows in (run.time_s.size, first + 1):
        part = replace(run, **{k: getattr(run, k)[:rows] for k in ("time_s", "speed_rpm", "peak_to_peak")})
        ended, out = write(tmp_path / f"{rows}", part), tmp_path / f"{rows}.csv"
        done = twingap(folder, "--out", out, "--limit", limit, "--prior", ended)
        assert done.status == 0 and f"--prior {ended}: end of life is reached at record 'ä {first}'" in done.err
        answers.append(out.read_bytes())
    assert first + 1 < run.time_s.size and answers[0] == answers[1]


def test_cells_that_no_record_set_may_have_are_refused_here_too(twingap: Run, folder: Path, tmp_path: Path) -> None:
    def changed(number: int, **cells: str) -> Path:
        def cell(rows: list[list[str]]) -> list[list[str]]:
            for name, text in cells.items():
                if name not in rows[0]:
                    rows = [[*rows[0], name], *([*row, ""] for row in rows[1:])]
                rows[number][rows[0].index(name)] = text
            return rows

        cell.__name__ = f"cell {len(list(folder.parent.iterdir()))}"
        return edited(folder, cell)

    out = tmp_path / "a.csv"
    for cells, parts in (
        ({"fs_hz": "-5000"}, ("row 8, column fs_hz", "'-5000'")), ({"fault": "broken"}, ("row 8, column fault",)),
        ({"load_n": "-1"}, ("row 8, column load_n",)), ({"load_n": "much"}, ("row 8, column load_n", "'much'")),
        ({"speed_rpm": "0", "file": "", "fs_hz": "0"}, ("row 8, column fs_hz",)),
        ({"speed_rpm": "0", "fault": "broken"}, ("row 8, column fault",)),
    ):  # fmt: skip
        refused(twingap(changed(7, **cells), "--out", out), *parts)
    wavfile.write(folder.parent / "rate.wav", 8000, np.zeros(256, np.int16))
    refused(twingap(changed(7, file="../rate.wav"), "--out", out), "row 8, column fs_hz", "8000 Hz", "10000 Hz")
    assert twingap(changed(7, file="../rate.wav", fs_hz="8000"), "--out", out).status == 0
    assert twingap(changed(7, speed_rpm="0", file="../rate.wav"), "--out", out).status == 0
    unstated = changed(7)
    text = (unstated / "recordset.toml").read_text("utf-8").replace("fs_hz", "# fs_hz")
    (unstated / "recordset.toml").write_text(text, "utf-8")
    refused(twingap(unstated, "--out", out), "row 2, column fs_hz", "no sampling rate")


def test_nothing_remains_to_be_said_where_no_time_passes(twingap: Run, folder: Path, tmp_path: Path) -> None:
    def at_once(rows: list[list[str]]) -> list[list[str]]:
        place = rows[0].index("time_s")
        return [rows[0], *([*row[:place], "5", *row[place + 1 :]] for row in rows[1:])]

    def at_first(rows: list[list[str]]) -> list[list[str]]:
        count = simulated().onset_row + 25
        return [*at_once(rows[: count + 1]), *rows[count + 1 :]]

    refused(twingap(edited(folder, at_once), "--out", tmp_path / "a.csv"), "time_s = 5", "no time passes")
    done = twingap(edited(folder, at_first), "--out", tmp_path / "a.csv", "--limit-ratio", simulated().limit_ratio)
    assert done.status == 0 and "no revolutions since the onset of the anomaly" in done.err
    rows = rows_of(tmp_path / "a.csv")[1:]
    timeless = rows[: simulated().onset_row + 25]
    assert any(row[1] == "1" for row in timeless) and all(row[2:] == [""] * 4 for row in timeless)
    assert all(row[2] for row in rows[len(timeless) + 1 :])


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


def too_fast(rows: list[list[str]]) -> list[list[str]]:
    rows[7][rows[0].index("speed_rpm")] = "1e300"
    return rows


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (too_fast, ("row 8, column speed_rpm", "rpm expected")),
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
        (("--limit-ratio", "1e308"), ("limit ratio = 1e+308", "at most 1e+06")),
        (("--group", "b"), ("'b'", "rig")), (("--prior", "nowhere"), ("nowhere", "does not exist")),
        (("--gaps", "perhaps"), ("perhaps",)), (("--limit", "inf"), ("--limit", "limit = inf, a positive amplitude")),
    ],
)  # fmt: skip
def test_impossible_options_are_refused_in_a_line(
    twingap: Run, folder: Path, tmp_path: Path, options: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    refused(twingap(folder, "--out", tmp_path / "a.csv", *options), *parts)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("row", "parts"),
    [
        ("a,1e5,2e5", ("after the anomaly", "row 2, column after_anomaly_revolutions")),
        ("a,1e300,", ("life of 1e+300 revolutions", "row 2, column life_revolutions")),
        ("a,1e-300,", ("life of 1e-300 revolutions",)),
    ],
)  # fmt: skip
def test_lives_that_no_run_has_are_refused(
    twingap: Run, folder: Path, tmp_path: Path, row: str, parts: tuple[str, ...]
) -> None:
    (tmp_path / "runs.csv").write_text(f"record,life_revolutions,after_anomaly_revolutions\n{row}\n", "utf-8")
    refused(twingap(folder, "--out", tmp_path / "a.csv", "--prior", tmp_path / "runs.csv"), *parts)
    assert not (tmp_path / "a.csv").exists()


def test_a_run_without_any_usable_record_is_refused(twingap: Run, tmp_path: Path) -> None:
    run = simulated()
    dead = write(tmp_path, replace(run, peak_to_peak=0.0 * run.peak_to_peak))
    refused(twingap(dead, "--out", tmp_path / "a.csv"), "no record can be used", "has no vibration", "more")
    assert not (tmp_path / "a.csv").exists()


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
        twingap(both, "--out", tmp_path / "a.csv", "--group", "a", "--prior", both), "a, b", "a separate record set"
    )
    done = twingap(both, "--out", tmp_path / "a.csv", "--group", "a")
    assert done.status == 0 and len(rows_of(tmp_path / "a.csv")) == 1 + (simulated().time_s.size + 1) // 2
