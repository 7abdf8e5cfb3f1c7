"""`twingap ui`: serves the runs made here until it is told to stop; a user's mistakes are one line."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.cli.ui import _address
from twingap.track import MlflowTracker

NewDatabase = Callable[[Path], str]


def start(folder: Path, *words: str) -> subprocess.Popen[str]:
    clean = {k: v for k, v in os.environ.items() if k not in ("MLFLOW_TRACKING_URI", "TWINGAP_HOME")}
    return subprocess.Popen(
        [sys.executable, "-m", "twingap.cli", "ui", *words],
        cwd=folder, env=clean, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.slow
def test_it_serves_the_runs_and_ends_cleanly(tmp_path: Path, new_database: NewDatabase) -> None:
    tracker = MlflowTracker(new_database(tmp_path / ".twingap" / "mlflow.db"), "paper3")
    with tracker.run("shown") as run:
        run.text("notes/ü.txt", "grüß")
    port = free_port()
    child = start(tmp_path, "--port", str(port))
    try:
        assert child.stdout is not None
        assert "mlflow.db" in child.stdout.readline()
        assert f"http://127.0.0.1:{port}/#/experiments/1/runs " in child.stdout.readline()
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=20) as page:
            assert b"<title>MLflow" in page.read()
        ask = urllib.request.Request(
            f"http://127.0.0.1:{port}/api/2.0/mlflow/runs/search",
            data=json.dumps({"experiment_ids": ["1"]}).encode(),
            headers={"Content-Type": "application/json"},
        )
        with urllib.request.urlopen(ask, timeout=20) as answer:
            (found,) = json.load(answer)["runs"]
        assert found["info"]["run_name"] == "shown"
        again = start(tmp_path, "--port", str(port))
        assert again.wait(30) == 2 and again.stderr is not None
        assert again.stderr.read().strip().endswith(f"choose another with --port, {port + 1} say")
    finally:
        child.send_signal(signal.SIGINT)
        said = child.communicate(timeout=30)
    assert child.returncode == 0 and said == ("", "")
    with socket.socket() as probe:  # no worker is left behind
        assert probe.connect_ex(("127.0.0.1", port)) != 0


@pytest.fixture
def ui(typed: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs `twingap ui ...` in an empty folder, where it does not serve."""
    monkeypatch.chdir(tmp_path)
    for name in ("MLFLOW_TRACKING_URI", "TWINGAP_HOME"):
        monkeypatch.delenv(name, raising=False)
    return partial(typed, "ui")


def test_nothing_to_show_is_one_line(ui: Run, tmp_path: Path, new_database: NewDatabase) -> None:
    MlflowTracker(new_database(tmp_path / "empty.db"), "paper3")
    (tmp_path / "text.db").write_text("no database " * 100)
    for words, expected in (
        ([], "no runs here yet; make one with twingap run or twingap bench"),
        (["--tracking-uri", f"sqlite:///{tmp_path / 'empty.db'}"], "no runs here yet"),
        (["--tracking-uri", f"sqlite:///{tmp_path / 'text.db'}"], "is no tracking store"),
    ):
        refused(ui(*words), expected)
    assert not (tmp_path / ".twingap").exists()


@pytest.mark.parametrize(("host", "shown"), [("127.0.0.1", "127.0.0.1"), ("0.0.0.0", "127.0.0.1"), ("::", "[::1]")])
def test_the_address_opens_the_experiment_of_the_latest_run(
    tmp_path: Path, new_database: NewDatabase, host: str, shown: str
) -> None:
    uri = new_database(tmp_path / "mlflow.db")
    first, second = MlflowTracker(uri, "paper1"), MlflowTracker(uri, "paper3")
    for tracker, experiment in ((second, 2), (first, 1)):
        with tracker.run("shown"):
            pass
        assert _address(uri, host, 5001) == f"http://{shown}:5001/#/experiments/{experiment}/runs"
    assert _address("postgresql://runs.example/mlflow", host, 5001) == f"http://{shown}:5001"


def test_a_server_is_named_not_served(ui: Run) -> None:
    assert "open http://runs.example:5000" in ui("--tracking-uri", "http://runs.example:5000").out
