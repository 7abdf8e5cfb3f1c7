"""`twingap health` as it is typed."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.bearing import BEARINGS
from twingap.prognosis.feature_table import read_feature_table
from twingap.records import Condition, Record
from twingap.records.folder import read_record_set, write_records

FILES = {"indicator.csv", "candidates.csv", "models.csv", "degradation.json", "degradation.png"}
Table = Callable[..., Path]


@pytest.fixture
def twingap(typed: Run) -> Run:
    """Runs `twingap health ...`."""
    return partial(typed, "health")


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def made(n: int = 80) -> list[dict[str, object]]:
    """A run whose rms rises from 1 to 5 by 4 u^6, whose kurtosis only scatters."""
    rng = np.random.default_rng(0)
    u = np.arange(n) / (n - 1)
    return [
        {"time_s": 600.0 * k, "name": f"snapshot {k}", "rms": 1 + 4 * u[k] ** 6 + 0.05 * rng.standard_normal(),
         "kurtosis": 3 + 0.1 * rng.standard_normal(), "index": k, "speed_rpm": 1800}
        for k in range(n)
    ]  # fmt: skip


@pytest.fixture
def table(tmp_path: Path) -> Table:
    """Writes rows as a feature table."""

    def write(rows: list[dict[str, object]], name: str = "Merkmale ü.csv") -> Path:
        path = tmp_path / name
        with path.open("w", encoding="utf-8", newline="") as stream:
            out = csv.DictWriter(stream, list(rows[0]))
            out.writeheader()
            out.writerows(rows)
        return path

    return write


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty-five records of two runs in one set."""
    folder = tmp_path_factory.mktemp("sets") / "Prüfstand 7"
    rng = np.random.default_rng(0)
    given = [
        Record(
            Condition(f"{run}, {k}", 1800.0, 25600.0, 1024, time_s=10.0 * k, group=run),
            (1 + 3 * (k / 44) ** 4) * rng.standard_normal(1024),
        )
        for run, count in (("ä", 45), ("b", 3))
        for k in range(count)
    ]
    return write_records(folder, "made", "g", BEARINGS["PRONOSTIA"], None, given)


def test_a_feature_table_becomes_indicator_models_and_figure(twingap: Run, table: Table, tmp_path: Path) -> None:
    out = tmp_path / "neu" / "zwölf"
    done = twingap(table(made()), "--out", out, "--indicator", "rms", "--limit", 8.0, "--healthy", 20)
    assert done.status == 0 and done.err == ""
    assert done.out.splitlines()[-5:] == [
        str(out / n) for n in ("indicator.csv", "candidates.csv", "models.csv", "degradation.json", "degradation.png")
    ]
    assert {p.name for p in out.iterdir()} == FILES
    assert "left out, since they contain no numbers: name" in done.out
    assert "left out, since they only count rows: index" in done.out
    assert (out / "degradation.png").read_bytes()[:4] == b"\x89PNG"
    indicator = rows_of(out / "indicator.csv")
    assert list(indicator[0]) == ["time_s", "indicator", "trend"] and len(indicator) == 80
    assert [r["candidate"] for r in rows_of(out / "candidates.csv") if r["chosen"] == "1"] == ["rms"]
    models = {r["model"]: r for r in rows_of(out / "models.csv")}
    # The indicator's zero is the healthy level, so that a power without offset says the same with a parameter less.
    assert len(models) == 8 and next(iter(models)) in ("power", "combined power 3")
    # 1 + 4 u^6 = 8 at u = (7 / 4)^(1 / 6) = 1.0978: 4637 s after the last record.
    life = models["combined power 3"]
    assert float(life["remaining_time_s"]) == pytest.approx(4637, rel=0.15)
    assert float(life["remaining_time_s_lo"]) < 4637 < float(life["remaining_time_s_hi"])
    assert models["constant"]["remaining_time_s"] == "" and float(models["constant"]["never_reached"]) > 0.9


def test_the_printed_equation_gives_the_curve(twingap: Run, tmp_path: Path) -> None:
    hours = np.arange(200)
    rms = 0.5 + 0.02 * np.exp(hours / 45)
    lines = [f"{1e9 + 600 * k},{value:.5f}" for k, value in zip(hours, rms, strict=True)]
    (tmp_path / "growth.csv").write_text("time_s,rms\n" + "\n".join(lines) + "\n")
    said = twingap(tmp_path / "growth.csv", "--out", tmp_path / "out", "--indicator", "rms")
    about = json.loads((tmp_path / "out/degradation.json").read_text())
    models = {model["model"]: model for model in about["models"]}
    c = models["exponential with offset"]["coefficients"]
    assert (c["a"], c["b"], c["c"]) == pytest.approx((0.02, 1 / 27000, 0.5), rel=0.01)
    for model in models.values():
        words, _, given = model["equation"].partition(", ")
        assert given == "t = time_s - 1000000000 in s"
        formula = words.removeprefix("rms = ").replace("exp(", "np.exp(").replace(" t", " * t").replace("^", "**")
        formula = re.sub(r"(?<=\d) np", " * np", formula)
        curve = eval(formula, {"np": np, "t": 600.0 * hours}) * np.ones(200)
        r2 = 1 - np.sum((curve - rms) ** 2) / np.sum((rms - rms.mean()) ** 2)
        assert r2 == pytest.approx(model["r2"], abs=2e-3)
    assert models["exponential with offset"]["r2"] > 0.99 and models["exponential with offset"]["equation"] in said.out
    assert models["power"]["not_fitted"] == ["c"]


def test_a_repeated_time_and_a_clock_set_back_are_noted(twingap: Run, table: Table, tmp_path: Path) -> None:
    rows = made()
    rows[7]["time_s"] = rows[6]["time_s"]
    rows[30]["time_s"] = float(str(rows[20]["time_s"])) + 1
    said = twingap(table(rows), "--out", tmp_path / "out")
    assert said.status == 0
    assert "1 row has the time of the row before" in said.out and "time_s goes back 1 time" in said.out


def test_same_seed_same_bytes_and_json(twingap: Run, table: Table, tmp_path: Path) -> None:
    source = table(made())
    first = twingap(source, "--out", tmp_path / "a", "--limit", 8, "--indicator", "rms", "--json", "--robust")
    about = json.loads(first.out)
    assert about["indicator"] == "rms" and about["preferred"] == about["models"][0]["model"]
    assert len(about["models"][0]["errors"]) >= 8 and first.err.splitlines()[-1] == str(tmp_path / "a/degradation.png")
    again = ("--limit", 8, "--indicator", "rms", "--robust")
    assert twingap(source, "--out", tmp_path / "b", *again).status == 0
    assert twingap(source, "--out", tmp_path / "c", *again, "--seed", 1).status == 0
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert (tmp_path / "a/models.csv").read_bytes() != (tmp_path / "c/models.csv").read_bytes()
    assert (tmp_path / "a/indicator.csv").read_bytes() == (tmp_path / "c/indicator.csv").read_bytes()


def test_an_indicator_named_reads_no_later_row(twingap: Run, table: Table, tmp_path: Path) -> None:
    rows = made()
    for name, part in (("whole", rows), ("cut", rows[:60])):
        source = table(part, f"{name}.csv")
        assert twingap(source, "--out", tmp_path / name, "--indicator", "rms").status == 0
    whole, cut = (rows_of(tmp_path / name / "indicator.csv") for name in ("whole", "cut"))
    assert whole[:60] == cut


def test_records_of_one_run(twingap: Run, records: Path, tmp_path: Path) -> None:
    refused(twingap(records, "--out", tmp_path / "no"), "contains 2 runs that overlap in time: ä, b", "--group")
    refused(twingap(records, "--out", tmp_path / "no", "--group", "c"), "no group 'c'")
    refused(twingap(records, "--out", tmp_path / "no", "--group", "b"), "3 records, at least 40 expected")
    done = twingap(records, "--out", tmp_path / "out", "--group", "ä", "--json")
    assert done.status == 0
    about = json.loads(done.out)
    assert about["run"] == "ä" and about["records"] == 45
    assert len(about["candidates"]) >= 28  # 15 features, and what they fuse to
    assert any("selected on the complete run" in note for note in about["notes"])
    assert not (tmp_path / "no").exists()


def test_silent_records_are_left_out_and_that_is_said(
    twingap: Run, table: Table, records: Path, tmp_path: Path
) -> None:
    rows = made()
    gone = [row for k, row in enumerate(rows) if k not in (50, 61)]
    for row in rows:
        del row["index"]  # counts rows while none is missing
    silent = [{**row, "rms": 0.01} if k in (50, 61) else row for k, row in enumerate(rows)]
    done = twingap(table(silent), "--out", tmp_path / "silent", "--indicator", "rms")
    assert done.status == 0 and "2 of 80 records are silent" in done.out and "30000 s, 36600 s" in done.out
    assert twingap(table(gone), "--out", tmp_path / "gone", "--indicator", "rms").status == 0
    assert (tmp_path / "silent/models.csv").read_bytes() == (tmp_path / "gone/models.csv").read_bytes()
    set_of = read_record_set(records).select(lambda c: c.group == "ä")
    dead = [Record(r.condition, 0.0 * r.samples if k == 40 else r.samples) for k, r in enumerate(set_of)]
    folder = write_records(tmp_path / "dead", "made", "g", BEARINGS["PRONOSTIA"], None, dead)
    done = twingap(folder, "--out", tmp_path / "out")
    assert done.status == 0 and "1 of 45 records are silent" in done.out
    short = [Record(replace(r.condition, n_samples=100), r.samples[:100]) for r in set_of]
    folder = write_records(tmp_path / "short", "made", "g", BEARINGS["PRONOSTIA"], None, short)
    refused(twingap(folder, "--out", tmp_path / "no"), "100 samples, at least 128 expected", "longer records")


def test_the_limit_of_a_fusion_feature_is_in_its_own_healthy_standard_deviations(
    twingap: Run, table: Table, tmp_path: Path
) -> None:
    """Features that scatter together: what they fuse to first has a deviation of sqrt 2, not of 1."""
    rng = np.random.default_rng(5)
    source = table([{**row, "peak": 3 * float(str(row["rms"])) + 0.01 * rng.standard_normal()} for row in made()])
    out = tmp_path / "out"
    typed = ("--indicator", "fusion 1", "--limit", 10, "--healthy", 30, "--json")
    about = json.loads(twingap(source, "--out", out, *typed).out)
    healthy = np.std([float(row["indicator"]) for row in rows_of(out / "indicator.csv")[:30]], ddof=1)
    assert healthy == pytest.approx(np.sqrt(2), rel=0.1)
    assert about["limit_in_indicator"] == pytest.approx(10 * healthy, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (
            ("--indicator", "rms", "--limit", 0.5),
            ("limit 0.5", "have rms 0.99", "rises from there, to 4.", "raise the"),
        ),
        (("--indicator", "rms", "--limit", -8), ("limit -8", "raise the limit, in the unit of the feature")),
        (
            ("--indicator", "health", "--limit", 1.5),
            ("limit 1.5", "have health -0.99", "falls from there", "lower the"),
        ),
        (("--indicator", "fusion 1", "--limit", -5), ("limit -5", "have fusion 1", "healthy standard deviations")),
    ],
)
def test_a_limit_on_the_side_that_the_run_has_left_is_refused(
    twingap: Run, table: Table, tmp_path: Path, options: tuple[object, ...], parts: tuple[str, ...]
) -> None:
    """A limit in g for features in m/s^2: it must not be reported as not reached."""
    source = table([{**row, "health": -float(str(row["rms"]))} for row in made()])
    refused(twingap(source, "--out", tmp_path / "out", *options), *parts)
    assert not (tmp_path / "out").exists()


def test_a_limit_below_is_reached_by_what_falls_and_said_where_nothing_moves(
    twingap: Run, table: Table, tmp_path: Path
) -> None:
    source = table([{**row, "health": 10 - float(str(row["rms"]))} for row in made()])
    done = twingap(source, "--out", tmp_path / "falls", "--indicator", "health", "--limit", 2.0)
    assert done.status == 0 and "move clearly" not in done.out
    models = {r["model"]: r for r in rows_of(tmp_path / "falls/models.csv")}
    assert float(models["combined power 3"]["remaining_time_s"]) == pytest.approx(4637, rel=0.15)  # as 8 of rms
    for limit, words in ((8.0, "is above that, so life is assumed to end where it rises"), (0.5, "where it falls")):
        out = tmp_path / str(limit)
        done = twingap(source, "--out", out, "--indicator", "kurtosis", "--limit", limit)
        assert done.status == 0 and "kurtosis does not move clearly" in done.out and words in done.out


def test_decibels_are_not_silent(twingap: Run, table: Table, tmp_path: Path) -> None:
    """Levels in dB lie about 0: a share of the healthy one is no bound to them."""
    rows = made()
    level = [{**row, "rms": 20 * np.log10(float(str(row["rms"])))} for row in rows]
    done = twingap(table(level), "--out", tmp_path / "dB", "--indicator", "rms", "--json")
    about = json.loads(done.out)
    below = sum(float(str(row["rms"])) < 0 for row in level)
    assert done.status == 0 and about["records"] == 80
    assert any(f"rms is below 0 in {below} of 80 records" in note for note in about["notes"])
    done = twingap(table([{**row, "rms": -float(str(row["rms"]))} for row in rows]), "--out", tmp_path / "minus")
    assert done.status == 0 and "below 0 in 80 of 80 records" in done.out and "are silent" not in done.out


def test_rows_out_of_order_are_sorted_and_that_is_said(twingap: Run, table: Table, tmp_path: Path) -> None:
    rows = made()
    for row in rows:  # counts rows only while they are in order
        del row["index"]
    sorted_out, other = tmp_path / "sorted", tmp_path / "other"
    assert twingap(table(rows), "--out", sorted_out, "--indicator", "rms").status == 0
    shuffled = [rows[k] for k in np.random.default_rng(1).permutation(len(rows))]
    done = twingap(table(shuffled), "--out", other, "--indicator", "rms")
    assert done.status == 0 and "rows are not in order of time" in done.out
    assert (sorted_out / "models.csv").read_bytes() == (other / "models.csv").read_bytes()


def test_a_constant_feature_is_left_out_and_that_is_said(twingap: Run, table: Table, tmp_path: Path) -> None:
    done = twingap(table([{**row, "flat": 2.5} for row in made()]), "--out", tmp_path / "out")
    assert done.status == 0 and "constant in the healthy records, left out: flat" in done.out


def test_mistakes_are_one_line_and_leave_nothing(twingap: Run, table: Table, tmp_path: Path) -> None:
    out = tmp_path / "out"
    rows = made()

    def changed(at: int, **cells: object) -> list[dict[str, object]]:
        return [{**row, **cells} if k == at else row for k, row in enumerate(rows)]

    def without(name: str) -> list[dict[str, object]]:
        return [{k: v for k, v in row.items() if k != name} for row in rows]

    bad: list[tuple[list[dict[str, object]], tuple[str, ...]]] = [
        (changed(7, rms="nan"), ("'nan' found, a number expected", "row 9, column rms")),
        (changed(7, rms="inf"), ("'inf' found", "row 9, column rms")),
        (changed(7, rms=-1e200), ("-1e+200 is too large", "row 9, column rms")),
        ([{**row, "rms": 1e-170} for row in rows], ("1e-170 is too small", "row 2, column rms")),
        ([{**row, "fusion 1": row["rms"]} for row in rows], ("a feature with the name 'fusion 1'", "rename it")),
        (changed(7, rms=""), ("an empty cell found", "row 9, column rms")),
        (changed(7, rms="high"), ("'high' found, a number expected", "row 9")),
        (changed(7, time_s=""), ("an empty cell", "row 9, column time_s")),
        ([{**row, "time_s": 600 * (k // 2)} for k, row in enumerate(rows)], ("40 of 80 rows have the time", "channel")),
        (without("time_s"), ("column 'time_s' is missing",)),
        ([{"time_s": row["time_s"], "name": row["name"]} for row in rows], ("no column of features",)),
        ([{"time_s": row["time_s"], "x": 1, "y": -2.5} for row in rows], ("all 2 features are constant",)),
        (rows[:1], ("1 record, at least 40 expected",)),
        (rows[:39], ("39 records, at least 40",)),
    ]
    for number, (wrong, parts) in enumerate(bad):
        refused(twingap(table(wrong, f"{number}.csv"), "--out", out), *parts)
    texts = {
        "empty.csv": ("", "is empty"), "header.csv": ("time_s,rms\n", "contains no records"),
        "ragged.csv": ("time_s,rms\n0,1\n1\n", "has 1 fields, 2 expected"),
        "twice.csv": ("time_s,rms,rms\n0,1,2\n", "column 'rms' appears twice"),
        "quote.csv": ('time_s,rms\n0,"1"x\n', "not a comma-separated table"),
        "semicolons.csv": ("time_s;rms\n0;1,5\n", "separate columns by commas"),
        "points.csv": ("time_s;rms\n0;1.5\n", "separate columns by commas"),
    }  # fmt: skip
    for name, (text, part) in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
        refused(twingap(tmp_path / name, "--out", out), part, name)
    (tmp_path / "latin.csv").write_bytes("time_s,größe\n0,1\n".encode("latin-1"))
    refused(twingap(tmp_path / "latin.csv", "--out", out), "not UTF-8")
    refused(twingap(tmp_path / "nowhere.csv", "--out", out), "nowhere.csv")
    good = table(rows)
    refused(twingap(good, "--out", out, "--indicator", "rums"), "no indicator 'rums'", "rms")
    refused(twingap(good, "--out", out, "--limit", "nan"), "finite number")
    refused(twingap(good, "--out", out, "--group", "x"), "no column 'group'")
    refused(twingap(good, "--out", tmp_path), "exists already")
    assert not out.exists()


def test_a_table_of_several_runs(twingap: Run, table: Table, tmp_path: Path) -> None:
    rows = [{**row, "group": g} for g in ("b1", "b2") for row in made()]
    source = table(rows)
    refused(twingap(source, "--out", tmp_path / "out"), "contains 2 runs that overlap in time: b1, b2", "--group")
    refused(twingap(source, "--out", tmp_path / "out", "--group", "b3"), "no group 'b3'")
    run, notes = read_feature_table(source, group="b2")
    assert run.name == "b2" and run.names == ("rms", "kurtosis") and run.time_s.size == 80 and len(notes) == 2


def test_recordings_that_follow_one_another_are_one_run(twingap: Run, table: Table, tmp_path: Path) -> None:
    rows = [{**row, "group": f"recording {k // 2}"} for k, row in enumerate(made())]
    run, notes = read_feature_table(table(rows))
    assert run.time_s.size == 80 and any("40 groups that follow one another" in note for note in notes)
    rng = np.random.default_rng(0)
    given = [
        Record(Condition(f"r{k}", 1800.0, 25600.0, 512, time_s=10.0 * k, group=f"g{k // 2}"), rng.standard_normal(512))
        for k in range(45)
    ]
    folder = write_records(tmp_path / "set", "made", "g", BEARINGS["PRONOSTIA"], None, given)
    text = (folder / "records.csv").read_text(encoding="utf-8").splitlines()
    speed = text[0].split(",").index("speed_rpm")
    for still in (11, 12):
        cells = text[still].split(",")
        cells[speed] = "0"
        text[still] = ",".join(cells)
    (folder / "records.csv").write_text("\n".join(text) + "\n", encoding="utf-8")
    done = twingap(folder, "--out", tmp_path / "out", "--healthy", 10)
    assert done.status == 0 and "stands still in 2 rows" in done.out and "groups that follow one another" in done.out
    assert len(rows_of(tmp_path / "out/indicator.csv")) == 43


def test_a_machine_that_stands_still_at_first_is_not_what_is_healthy(
    twingap: Run, table: Table, tmp_path: Path
) -> None:
    rows = [{**row, "rms": 0.0 if k < 20 else row["rms"]} for k, row in enumerate(made())]
    for row in rows:
        del row["index"]
    done = twingap(table(rows), "--out", tmp_path / "out", "--indicator", "rms")
    assert done.status == 0 and "20 of 80 records are silent" in done.out
    quiet = [{**row, "rms": 0.01 if k < 20 else row["rms"]} for k, row in enumerate(rows)]
    assert "20 of 80 records are silent" in twingap(table(quiet, "q.csv"), "--out", tmp_path / "two").out


@pytest.mark.parametrize("scale", [1e200, 1e-200])
def test_what_no_accelerometer_measures_is_refused(twingap: Run, tmp_path: Path, scale: float) -> None:
    rng = np.random.default_rng(0)
    given = [
        Record(Condition(f"r{k}", 1800.0, 25600.0, 1024, time_s=10.0 * k), scale * rng.standard_normal(1024))
        for k in range(45)
    ]
    folder = write_records(tmp_path / "set", "made", "g", BEARINGS["PRONOSTIA"], None, given)
    refused(twingap(folder, "--out", tmp_path / "out"), "record 'r0'", "no accelerometer", "how the file was read")


def test_records_without_time_are_refused(twingap: Run, tmp_path: Path) -> None:
    given = [
        Record(Condition(f"r{k}", 1800.0, 25600.0, 1024), np.random.default_rng(k).standard_normal(1024))
        for k in range(45)
    ]
    folder = write_records(tmp_path / "set", "made", "g", BEARINGS["PRONOSTIA"], None, given)
    refused(twingap(folder, "--out", tmp_path / "out"), "45 of 45 records have no time_s", "add a column time_s")
