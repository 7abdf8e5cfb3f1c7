"""Tracking: what is logged can be read back, from SQLite, a real server and folders; refusals are one line."""

from __future__ import annotations

import ast
import contextlib
import json
import math
import signal
import socket
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twingap
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_path, digest_of_value, versions
from twingap.sweep import sweep
from twingap.track import LONGEST_VALUE, MlflowTracker, NullTracker, Tracker, tracking_uri
from twingap.track.folder import FolderTracker
from twingap.track.server import runs_in, serving
from twingap.track.tidy import clean_file, clean_name, flat_table

matplotlib.use("Agg")
SWEEP_JOBS = Path(__file__).parents[1] / "sweep"
NewDatabase = Callable[[Path], str]
TABLE = pd.DataFrame({"task": ["0→2", "2→0"], "mean": [0.8125, math.nan]})


@dataclass(frozen=True)
class Inner:
    rate: float = 1e-3


@dataclass(frozen=True)
class Settings:
    epochs: int = 3
    inner: Inner = Inner()
    notes: str = "x" * (LONGEST_VALUE + 1)


def log_everything(tracker: Tracker, tmp_path: Path) -> None:
    """One run with one of everything, and two runs inside."""
    import matplotlib.pyplot as plt
    import plotly.graph_objects as go

    figure, axes = plt.subplots(figsize=(2, 2))
    axes.plot([1, 3, 2])
    (tmp_path / "given").mkdir(exist_ok=True)
    (tmp_path / "given" / "a.txt").write_text("a")
    with tracker.run("Prüfung", tags={"paper": 3}) as run:
        run.parameters(Settings())
        run.metrics({"accuracy (%)": 81.5, "gone": None, "nan": math.nan, "a[1]": 1.0, "a{1}": 2.0})
        for step in range(3):
            run.metrics({"loss": 1.0 / (1 + step)}, step=step)
        run.table("accuracy", TABLE)
        run.table("accuracy", TABLE)
        run.figure("curve", figure)
        run.figure("interactive", go.Figure(go.Scatter(y=[1, 2])))
        run.data("cwru", "ab" * 32, role="test", source="https://example.org")
        run.twin("[twin]\nmodel = 'contact'\n")
        run.file(tmp_path / "given")
        for seed in range(2):
            with run.run(f"seed {seed}", duration_s=90.0) as inner:
                inner.metrics({"accuracy": seed})
    plt.close(figure)


def check_mlflow(uri: str, experiment: str) -> None:
    """What `log_everything` logged is all there."""
    import mlflow

    client = mlflow.MlflowClient(uri)
    found = client.get_experiment_by_name(experiment)
    runs = {r.info.run_name: r for r in client.search_runs([found.experiment_id])}
    run = runs["Prüfung"]
    assert run.info.status == "FINISHED" and run.data.tags["paper"] == "3"
    assert run.data.params["inner.rate"] == "0.001" and len(run.data.params["notes"]) <= LONGEST_VALUE
    assert run.data.metrics["accuracy percent"] == 81.5 and run.data.tags["not_measured"] == "gone, nan"
    assert sorted(v for k, v in run.data.metrics.items() if k.startswith("a_1_")) == [1.0, 2.0]
    assert [m.value for m in client.get_metric_history(run.info.run_id, "loss")] == [1.0, 0.5, 1.0 / 3]
    # What MLflow's load_table and its UI read: the table's place in this tag, and its JSON.
    assert json.loads(run.data.tags["mlflow.loggedArtifacts"]) == [{"path": "tables/accuracy.json", "type": "table"}]
    table = pd.read_json(client.download_artifacts(run.info.run_id, "tables/accuracy.json"), orient="split")
    pd.testing.assert_frame_equal(table.astype(TABLE.dtypes), TABLE)
    paths = {
        f.path
        for top in client.list_artifacts(run.info.run_id)
        for f in client.list_artifacts(run.info.run_id, top.path)
    }
    assert {"figures/curve.png", "figures/curve.svg", "figures/interactive.html", "tables/accuracy.csv",
            "parameters/notes.txt", "twin/twin.toml", "given/a.txt"} <= paths  # fmt: skip
    assert any(path.startswith("images/curve") for path in paths), "figures can be laid side by side"
    assert run.inputs.dataset_inputs[0].dataset.name == "cwru" and run.data.tags["data.test.cwru"] == "ab" * 32
    assert run.data.tags["version.twingap"] == twingap.__version__ and run.data.tags["version.numpy"] == np.__version__
    assert runs["seed 1"].data.tags["mlflow.parentRunId"] == run.info.run_id
    assert 90_000 <= runs["seed 1"].info.end_time - runs["seed 1"].info.start_time < 600_000


def test_sqlite_keeps_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "Prüf stand 100%"
    monkeypatch.setenv("TWINGAP_HOME", str(home))
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    tracker = MlflowTracker(experiment="paper3 ü")
    log_everything(tracker, tmp_path)
    assert tracker.uri == f"sqlite:///{home / 'mlflow.db'}"
    check_mlflow(tracker.uri, "paper3 ü")
    assert list((home / "artifacts").rglob("curve.png")), "artifacts lie beside the database"


@pytest.mark.slow
def test_a_real_server_keeps_everything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, new_database: NewDatabase
) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with serving(new_database(tmp_path / "server" / "mlflow.db"), "127.0.0.1", port, need_runs=False):
        monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://127.0.0.1:{port}")
        tracker = MlflowTracker(experiment="remote")
        assert tracker.uri == f"http://127.0.0.1:{port}"
        log_everything(tracker, tmp_path)
        check_mlflow(tracker.uri, "remote")
    assert list((tmp_path / "server" / "artifacts").rglob("curve.png")), "artifacts went through the server"
    with pytest.raises(TwingapError, match="does not answer") as caught:
        MlflowTracker(experiment="remote")
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_folders_keep_everything(tmp_path: Path) -> None:
    log_everything(FolderTracker(tmp_path / "runs"), tmp_path)
    log_everything(NullTracker(), tmp_path)
    run = tmp_path / "runs" / "000-Prüfung"
    tags = json.loads((run / "tags.json").read_text(encoding="utf-8"))
    assert tags["status"] == "FINISHED" and tags["data.test.cwru"] == "ab" * 32 and tags["not_measured"] == "gone, nan"
    assert json.loads((run / "parameters.json").read_text())["inner.rate"] == "0.001"
    assert (run / "parameters" / "notes.txt").read_text() == Settings().notes
    assert "loss,2,0.3333333333333333" in (run / "metrics.csv").read_text().splitlines()
    pd.testing.assert_frame_equal(pd.read_csv(run / "tables" / "accuracy.csv"), TABLE)
    assert (run / "figures" / "curve.png").exists() and (run / "runs" / "001-seed 1" / "metrics.csv").exists()


@pytest.mark.parametrize(("error", "status"), [(ValueError, "FAILED"), (KeyboardInterrupt, "KILLED")])
def test_a_run_says_how_it_ended(
    tmp_path: Path, new_database: NewDatabase, error: type[BaseException], status: str
) -> None:
    tracker = MlflowTracker(new_database(tmp_path / "mlflow.db"), "ends")
    with pytest.raises(error), tracker.run("outer") as run, run.run("inner"):
        raise error
    with sqlite3.connect(tmp_path / "mlflow.db") as database:
        assert set(database.execute("SELECT name, status FROM runs")) == {("outer", status), ("inner", status)}


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit, None])
def test_what_ended_a_run_goes_on_where_the_run_cannot_be_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException] | None
) -> None:
    tried = []

    def full(run: object, status: str) -> None:
        tried.append(status)
        raise OSError("no space left on device")

    monkeypatch.setattr("twingap.track.folder._FolderRun._end", full)
    # A run that finished did not where its end cannot be kept: that is told.
    with pytest.raises(error or OSError), FolderTracker(tmp_path).run("outer") as run, run.run("inner"):
        if error is not None:
            raise error
    ended = {None: "FINISHED", KeyboardInterrupt: "KILLED"}.get(error, "FAILED")
    assert tried[0] == ended and len(tried) == 2


def test_parallel_work_logs_through_the_parent(
    tmp_path: Path, new_database: NewDatabase, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(SWEEP_JOBS))
    import sweep_jobs

    tracker = MlflowTracker(new_database(tmp_path / "mlflow.db"), "sweep")
    with tracker.run("sweep") as run:

        def log(result: Any) -> None:
            with run.run(result.label) as inner:
                inner.parameters({"seed": result.job.seed})
                inner.metrics({"mean": result.value["mean"]})

        sweep(sweep_jobs.draw, [sweep_jobs.Draw(s) for s in range(40)], n_jobs=4, on_result=log)
    with sqlite3.connect(tmp_path / "mlflow.db") as database:
        rows = dict(database.execute("SELECT p.value, m.value FROM params p JOIN metrics m USING (run_uuid)"))
    assert rows == {str(s): sweep_jobs.draw(sweep_jobs.Draw(s))["mean"] for s in range(40)}


def test_two_processes_open_a_fresh_store_at_once(tmp_path: Path) -> None:
    script = (
        "import sys; from twingap.track import MlflowTracker\n"
        "with MlflowTracker(sys.argv[1], 'both').run(sys.argv[2]) as run:\n"
        "    [run.metrics({'x': i}, step=i) for i in range(30)]"
    )
    uri = f"sqlite:///{tmp_path / 'mlflow.db'}"
    started = [
        subprocess.Popen([sys.executable, "-c", script, uri, name], stderr=subprocess.PIPE, text=True)
        for name in ("one", "two")
    ]
    said = [child.communicate(timeout=120)[1] for child in started]
    assert [child.returncode for child in started] == [0, 0], said
    assert said == ["", ""], "MLflow's own chatter is kept quiet"
    with sqlite3.connect(tmp_path / "mlflow.db") as database:
        assert database.execute("SELECT count(*) FROM experiments WHERE name = 'both'").fetchone() == (1,)
        assert database.execute("SELECT count(*) FROM metrics").fetchone() == (60,)


@pytest.mark.slow
@pytest.mark.parametrize("statements", [20, 400])
def test_a_store_is_made_whole_or_not_at_all(tmp_path: Path, statements: int) -> None:
    """A process that is killed while it makes the tables of a new store leaves nothing that the next stumbles on."""
    script = (
        "import os, signal, sys\n"
        "from sqlalchemy import event\n"
        "from sqlalchemy.engine import Engine\n"
        "from twingap.track import MlflowTracker\n"
        "left = int(sys.argv[2])\n"
        "def count(*_):\n"
        "    global left\n"
        "    left -= 1\n"
        "    left or os.kill(os.getpid(), signal.SIGKILL)\n"
        "event.listen(Engine, 'after_cursor_execute', count)\n"
        "MlflowTracker(sys.argv[1])"
    )
    path = tmp_path / "mlflow.db"
    killed = subprocess.run([sys.executable, "-c", script, f"sqlite:///{path}", str(statements)])
    assert killed.returncode == -signal.SIGKILL
    with contextlib.closing(sqlite3.connect(path)) as database:
        assert database.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
    with MlflowTracker(f"sqlite:///{path}").run("after") as run:
        run.metrics({"x": 1.0})
    assert runs_in(path) == 1


def test_stores_that_cannot_be_used_say_so_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "text.db").write_text("no database " * 100)
    (tmp_path / "folder.db").mkdir()
    cases = {
        f"sqlite:///{tmp_path / 'file' / 'mlflow.db'}": "cannot be used",
        f"sqlite:///{tmp_path / 'text.db'}": "not a database",
        f"sqlite:///{tmp_path / 'folder.db'}": "unable to open",
        "http://127.0.0.1:9": "does not answer",
        "gopher://somewhere": "tracking store gopher",
    }
    for uri, expected in cases.items():
        with pytest.raises(TwingapError) as caught:
            MlflowTracker(uri)
        assert expected in str(caught.value) and "\n" not in str(caught.value)


def test_a_store_of_a_newer_mlflow_says_what_helps(tmp_path: Path, new_database: NewDatabase) -> None:
    path = tmp_path / "mlflow.db"
    MlflowTracker(new_database(path))
    with sqlite3.connect(path) as database:
        database.execute("UPDATE alembic_version SET version_num = 'ffffffffffff'")
    for use in (lambda: MlflowTracker(f"sqlite:///{path}"), lambda: runs_in(path)):
        with pytest.raises(TwingapError, match=r"written by a newer MLflow than .*; update it \(pip install --upgrade"):
            use()


def test_a_store_of_an_older_mlflow_says_what_helps(tmp_path: Path, new_database: NewDatabase) -> None:
    path = tmp_path / "mlflow.db"
    new_database(path)
    with sqlite3.connect(path) as database:
        database.execute("UPDATE alembic_version SET version_num = '75868b020152'")
    with pytest.raises(
        TwingapError, match="was written by an older MLflow; make a copy of it, then: mlflow db upgrade"
    ):
        MlflowTracker(f"sqlite:///{path}")


def test_a_locked_store_says_so(tmp_path: Path, new_database: NewDatabase, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("twingap.track.database.PATIENCE_S", 0.1)
    path = tmp_path / "mlflow.db"
    MlflowTracker(new_database(path))
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        for use in (lambda: MlflowTracker(f"sqlite:///{path}"), lambda: runs_in(path)):
            with pytest.raises(TwingapError, match=r"is locked: .*; wait for that run to end, or close the program"):
                use()


def test_a_deleted_experiment_says_how_to_bring_it_back(tmp_path: Path, new_database: NewDatabase) -> None:
    import mlflow

    uri = new_database(tmp_path / "mlflow.db")
    MlflowTracker(uri, "gone")
    client = mlflow.MlflowClient(uri)
    client.delete_experiment(client.get_experiment_by_name("gone").experiment_id)
    with pytest.raises(TwingapError, match="mlflow experiments restore"):
        MlflowTracker(uri, "gone")


def test_where_runs_go(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("TWINGAP_HOME", raising=False)
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    assert tracking_uri() == f"sqlite:///{tmp_path / '.twingap' / 'mlflow.db'}"
    monkeypatch.setenv("TWINGAP_HOME", str(tmp_path / "home"))
    assert tracking_uri() == f"sqlite:///{tmp_path / 'home' / 'mlflow.db'}"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://a:1")
    assert tracking_uri() == "http://a:1" and tracking_uri("http://b:2") == "http://b:2"


def test_only_track_imports_mlflow() -> None:
    root = Path(twingap.__file__).parent
    importers = set()
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if any(name.partition(".")[0] == "mlflow" for name in names):
                importers.add(path.relative_to(root).as_posix())
    assert {path.partition("/")[0] for path in importers} == {"track"}


@given(st.text())
def test_any_name_becomes_one_that_mlflow_takes(name: str) -> None:
    from mlflow.utils.validation import _validate_metric_name

    _validate_metric_name(clean_name(name))
    assert (
        clean_file(name) and not set(clean_file(name)) & set('/\\\0\n:*?"<>|') and clean_file(name) not in (".", "..")
    )


def test_tables_keep_their_index_and_headings() -> None:
    wide = pd.DataFrame(
        [[1, 2]], columns=pd.MultiIndex.from_tuples([("a", "x"), ("b", "")]), index=pd.Index(["r"], name="k")
    )
    assert list(flat_table(wide).columns) == ["k", "a x", "b"] and flat_table(wide)["k"].tolist() == ["r"]
    assert list(flat_table(TABLE).columns) == ["task", "mean"]


def test_digests_change_with_what_they_stand_for(tmp_path: Path) -> None:
    assert digest_of_value({"a": 1, "b": 2}) == digest_of_value({"b": 2, "a": 1}) != digest_of_value({"a": 1, "b": 2.0})
    (tmp_path / "a").write_text("1")
    before = digest_of_path(tmp_path)
    (tmp_path / "a").rename(tmp_path / "b")
    assert digest_of_path(tmp_path) != before
    assert digest_of_code(twingap.bearing) == digest_of_code(twingap.Bearing) != digest_of_code(twingap.records)
    assert versions()["python"] == ".".join(map(str, sys.version_info[:3]))
