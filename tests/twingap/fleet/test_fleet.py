"""`twingap fleet` on a small fleet: killed, resumed, in parallel, with sets that changed and sets that are bad."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.twingap.cli.typed import Run, refused
from tests.twingap.fleet.conftest import BAD, COARSE, LAST, PLAIN, write_machine
from twingap.fleet import run_fleet
from twingap.fleet.diagnoses import STORE
from twingap.gap import diagnose, read_report
from twingap.gap.report.files import to_json
from twingap.sweep.store import ResultStore

FLEET = ("fleet.json", "fleet.csv", "fleet.html")


class Finished(NamedTuple):
    """A fleet that was killed and resumed."""

    out: Path
    uri: str
    at_kill: dict[str, bytes]


def results(out: Path) -> dict[str, bytes]:
    """Finished diagnoses of an output folder, by name of their file."""
    found = (path for path in (out / STORE).glob("*.json") if not path.name.startswith("."))  # not one being written
    return {path.name: path.read_bytes() for path in found}


@pytest.fixture(scope="module")
def finished(
    machines: Path, twin: Path, tmp_path_factory: pytest.TempPathFactory, new_database: Callable[[Path], str]
) -> Finished:
    """Killed -9 after the first diagnosis, and resumed with tracking."""
    folder = tmp_path_factory.mktemp("killed")
    out, uri = folder / "Ergebnis ü", new_database(folder / "runs.db")
    command = [sys.executable, "-m", "twingap.cli", "fleet", str(machines), "--twin", str(twin), "--out", str(out)]
    command += ["--jobs", "1", "--seed", "3", "--quick", "--tracking-uri", uri]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not results(out) and process.poll() is None:
            time.sleep(0.05)
        assert process.poll() is None, process.communicate()
        os.kill(process.pid, signal.SIGKILL)
    at_kill = results(out)
    assert not any((out / name).exists() for name in FLEET)
    again = subprocess.run(command, capture_output=True, text=True)
    assert again.returncode == 0, again.stderr
    assert again.stdout.splitlines()[-3:] == [str(out / name) for name in FLEET]
    assert f"not diagnosed: {BAD}: {BAD}/records.csv" in again.stdout
    return Finished(out, uri, at_kill)


def without_run_time(path: Path) -> dict[str, Any]:
    table: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    assert table["provenance"].pop("runtime_s") > 0
    return table


@pytest.mark.slow
def test_a_killed_fleet_resumes_to_the_same_bytes(
    finished: Finished, machines: Path, twin: Path, tmp_path: Path, typed: Run
) -> None:
    now = results(finished.out)
    assert len(finished.at_kill) < len(now) == 3
    assert all(now[name] == content for name, content in finished.at_kill.items())
    said = typed(
        "fleet",
        machines,
        "--twin",
        twin,
        "--out",
        tmp_path,
        "--jobs",
        2,
        "--seed",
        3,
        "--quick",
        "--no-track",
        "--json",
    )
    assert said.status == 0, said.err
    assert json.loads(said.out) == json.loads((tmp_path / "fleet.json").read_text(encoding="utf-8"))
    for name in FLEET:
        assert (tmp_path / name).read_bytes() == (finished.out / name).read_bytes()
    for path in (COARSE, PLAIN, LAST):
        pages = [out / path / "report.html" for out in (tmp_path, finished.out)]
        assert pages[0].read_bytes() == pages[1].read_bytes()
        tables = [without_run_time(out / path / "gap.json") for out in (tmp_path, finished.out)]
        assert tables[0] == tables[1]


@pytest.mark.slow
def test_each_machine_has_the_report_of_a_diagnosis_of_its_own(finished: Finished, machines: Path, twin: Path) -> None:
    alone = to_json(diagnose(machines / PLAIN, twin, seed=3, quick=True).report)
    del alone["provenance"]["runtime_s"]
    assert without_run_time(finished.out / PLAIN / "gap.json") == json.loads(json.dumps(alone))


@pytest.mark.slow
def test_the_fleet_has_a_row_for_each_machine_and_says_what_they_share(finished: Finished) -> None:
    table = json.loads((finished.out / "fleet.json").read_text(encoding="utf-8"))
    rows = {row["path"]: row for row in table["machines"]}
    assert rows.keys() == {COARSE, PLAIN, LAST, BAD}
    assert rows[BAD]["status"] == "not_diagnosed" and "records.csv" in rows[BAD]["reason"]
    paths = [row["path"] for row in table["machines"]]
    assert paths.index(COARSE) < paths.index(PLAIN) and paths[-1] == BAD
    assert rows[COARSE]["effects"] == list(read_report(finished.out / COARSE).verdict.effects)
    assert "quantisation" in rows[COARSE]["effects"]
    (shared,) = (row for row in table["effects"] if row["effect"] == "quantisation")
    assert (shared["named"], shared["of"]) == (1, 3)
    assert shared["rate_ci"] == pytest.approx([0.016952, 0.864650], abs=1e-5)  # tables of Clopper and Pearson
    csv = (finished.out / "fleet.csv").read_text(encoding="utf-8").splitlines()
    assert len(csv) == 5 and csv[0].startswith("machine,status,effects,")
    assert not (finished.out / BAD).exists()


@pytest.mark.slow
def test_one_run_holds_a_run_for_each_machine(finished: Finished) -> None:
    import mlflow

    client = mlflow.MlflowClient(finished.uri)
    runs = client.search_runs([client.get_experiment_by_name("fleet").experiment_id])
    (parent,) = (run for run in runs if "mlflow.parentRunId" not in run.data.tags)
    inside = {run.data.tags["machine"]: run for run in runs if run is not parent}
    assert inside.keys() == {COARSE, PLAIN, LAST, BAD}
    assert {run.data.tags["mlflow.parentRunId"] for run in inside.values()} == {parent.info.run_id}
    assert parent.data.metrics["status/not_diagnosed"] == 1 and parent.data.metrics["machines"] == 4
    stated = read_report(finished.out / COARSE).provenance
    took = (inside[COARSE].info.end_time - inside[COARSE].info.start_time) / 1000
    assert took == pytest.approx(stated["runtime_s"], abs=30) and took >= stated["runtime_s"] - 1
    assert {file.path for file in client.list_artifacts(inside[PLAIN].info.run_id)} >= {"gap.json", "report.html"}
    assert {file.path for file in client.list_artifacts(parent.info.run_id)} >= set(FLEET)


@pytest.fixture
def copied(finished: Finished, machines: Path, tmp_path: Path) -> tuple[Path, Path]:
    """The fleet and its results, to be changed."""
    shutil.copytree(machines, tmp_path / machines.name)
    shutil.copytree(finished.out, tmp_path / "out")
    return tmp_path / machines.name, tmp_path / "out"


@pytest.mark.slow
def test_what_changed_is_diagnosed_again_and_nothing_else(copied: tuple[Path, Path], twin: Path) -> None:
    folder, out = copied
    shutil.rmtree(folder / LAST)
    write_machine(folder / LAST, (), 4)
    kept = {path: (out / path / "gap.json").stat().st_mtime_ns for path in (COARSE, PLAIN, LAST)}
    before, digest = results(out), read_report(out / LAST).provenance["records_sha256"]
    (out / COARSE / "report.html").unlink()  # lost, but its diagnosis is kept
    found = run_fleet(folder, twin, out, seed=3, quick=True, backend="sequential")
    new = results(out).keys() - before.keys()
    assert [json.loads((out / STORE / name).read_text())["identity"]["job"]["path"] for name in new] == [LAST]
    assert read_report(out / LAST).provenance["records_sha256"] != digest
    assert (out / PLAIN / "gap.json").stat().st_mtime_ns == kept[PLAIN]
    assert (out / COARSE / "report.html").is_file()
    assert found.statuses["not_diagnosed"] == 1


@pytest.mark.slow
def test_a_set_that_became_bad_loses_its_report(copied: tuple[Path, Path], twin: Path) -> None:
    folder, out = copied
    for path in (PLAIN, LAST):
        shutil.rmtree(folder / path)
    write_machine(folder / PLAIN, (), 2, count=1)
    (out / PLAIN / "mine.txt").write_text("kept")
    found = run_fleet(folder, twin, out, seed=3, quick=True, backend="sequential")
    reasons = {machine.path: machine.reason for machine in found.machines}
    assert reasons.keys() == {COARSE, PLAIN, BAD} and "at least 2 expected" in reasons[PLAIN]
    assert [path.name for path in (out / PLAIN).iterdir()] == ["mine.txt"]
    assert len(results(out)) == 3


@pytest.mark.slow
def test_another_twin_or_seed_is_another_diagnosis(copied: tuple[Path, Path], twin: Path, tmp_path: Path) -> None:
    folder, out = copied
    for path in (COARSE, LAST, BAD):
        shutil.rmtree(folder / path)
    same = tmp_path / twin.name
    same.write_text("# a remark\n" + twin.read_text(encoding="utf-8"), encoding="utf-8")
    run_fleet(folder, same, out, seed=3, quick=True, backend="sequential")
    assert len(results(out)) == 3
    same.write_text('[twin]\nmodel = "phenomenological"\n[parameters]\ndamping_ratio = 0.04\n', encoding="utf-8")
    run_fleet(folder, same, out, seed=3, quick=True, backend="sequential")
    assert len(results(out)) == 4


@pytest.mark.slow
def test_two_commands_do_not_write_one_folder(typed: Run, copied: tuple[Path, Path], twin: Path) -> None:
    folder, out = copied
    before = (out / "fleet.json").read_bytes()
    with ResultStore(out / STORE).claimed():
        said = typed("fleet", folder, "--twin", twin, "--out", out, "--no-track")
    refused(said, "another sweep is at work here")
    assert (out / "fleet.json").read_bytes() == before


def test_what_is_wrong_is_said_in_one_line(typed: Run, machines: Path, twin: Path, tmp_path: Path) -> None:
    (tmp_path / "empty" / "deep").mkdir(parents=True)
    bad = tmp_path / "only bad" / "set"
    bad.mkdir(parents=True)
    (bad / "records.csv").write_text("record,file,speed_rpm\n")
    before = sorted(tmp_path.rglob("*"))
    out = ("--out", tmp_path / "out", "--no-track")
    refused(typed("fleet", tmp_path / "empty", "--twin", twin, *out), "empty: holds no record set", "twingap import")
    refused(typed("fleet", tmp_path / "none", "--twin", twin, *out), "none: no such folder")
    refused(typed("fleet", machines, "--twin", tmp_path / "none.toml", *out), "none.toml")
    refused(typed("fleet", machines, "--twin", twin, "--out", machines, "--no-track"), "is the folder of the records")
    refused(typed("fleet", machines, "--twin", twin, "--out", twin, "--no-track"), twin.name)
    said = typed("fleet", bad.parent, "--twin", twin, *out, "--jobs", 1)
    refused(said, "none of 1 record sets could be diagnosed: set: set: holds no recordset.toml")
    broken = bad.parent / os.fsdecode(b"\xff")
    broken.mkdir()
    (broken / "records.csv").touch()
    said = typed("fleet", bad.parent, "--twin", twin, *out, "--jobs", 1)
    refused(said, "none of 2", "\\udcff: the path is not UTF-8")
    shutil.rmtree(broken)
    address = ("--address", "tcp://127.0.0.1:9")
    refused(typed("fleet", machines, "--twin", twin, *out, *address), "backend 'loky' has no address")
    assert sorted(tmp_path.rglob("*")) == before
    assert not any((machines / name).exists() for name in FLEET)
