"""`twingap ui`: serves the runs made here until it is told to stop; a user's mistakes are one line."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from twingap.track import MlflowTracker


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
def test_it_serves_the_runs_and_ends_cleanly(tmp_path: Path) -> None:
    tracker = MlflowTracker(f"sqlite:///{tmp_path / '.twingap' / 'mlflow.db'}", "paper3")
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


def test_nothing_to_show_is_one_line(tmp_path: Path) -> None:
    MlflowTracker(f"sqlite:///{tmp_path / 'empty.db'}", "paper3")
    (tmp_path / "text.db").write_text("no database " * 100)
    for words, expected in (
        ([], "no runs here yet; make one with twingap run or twingap bench"),
        (["--tracking-uri", f"sqlite:///{tmp_path / 'empty.db'}"], "no runs here yet"),
        (["--tracking-uri", f"sqlite:///{tmp_path / 'text.db'}"], "is no tracking store"),
    ):
        child = start(tmp_path, *words)
        out, err = child.communicate(timeout=60)
        assert child.returncode == 2 and out == "" and err.count("\n") == 1 and expected in err
    assert not (tmp_path / ".twingap").exists()


def test_a_server_is_named_not_served(tmp_path: Path) -> None:
    out, _ = start(tmp_path, "--tracking-uri", "http://runs.example:5000").communicate(timeout=60)
    assert "open http://runs.example:5000" in out
