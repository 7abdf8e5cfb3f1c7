"""MLflow's server on PostgreSQL: eight writers at once, and a server that goes away in the middle."""

from __future__ import annotations

import importlib.util
import os
import pwd
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults.conftest import FULL
from twingap.track import MlflowTracker

WRITERS, ROUNDS = 8, 6
AWAY_S = 8.0
pytestmark = pytest.mark.skipif(not FULL, reason="starts two servers; part of tox -e faults")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _wait_for(port: int) -> None:
    """Wait until the database answers."""
    import psycopg

    until = time.monotonic() + 60
    while True:
        try:
            psycopg.connect(host="127.0.0.1", port=port, user="twingap", dbname="postgres").close()
            return
        except psycopg.OperationalError:
            assert time.monotonic() < until
            time.sleep(0.2)


@pytest.fixture
def database() -> Iterator[str]:
    """Address of a PostgreSQL server started here."""
    beside = sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    programs = shutil.which("initdb") or (beside and str(beside[-1] / "initdb"))
    if not programs:
        pytest.skip("PostgreSQL is not installed")
    if importlib.util.find_spec("psycopg") is None:
        pytest.skip("psycopg is not installed")
    programs = Path(programs).resolve().parent
    place = Path(tempfile.mkdtemp(prefix="twingap-postgres-"))  # where another user may enter, and paths are short
    own = {}
    if os.getuid() == 0:  # PostgreSQL refuses to run as root
        nobody = pwd.getpwnam("nobody")
        os.chown(place, nobody.pw_uid, nobody.pw_gid)
        own = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
    port, data = free_port(), place / "data"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": place, **own}
    server = None
    try:
        subprocess.run([programs / "initdb", "-D", data, "-U", "twingap", "-A", "trust", "-N"], check=True, **quiet)
        options = ["-D", data, "-p", str(port), "-k", place, "-c", "listen_addresses=127.0.0.1"]
        server = subprocess.Popen([programs / "postgres", *options], **quiet)
        _wait_for(port)
        yield f"postgresql://twingap@127.0.0.1:{port}/postgres"
    finally:
        if server is not None:
            server.send_signal(signal.SIGQUIT)
            server.wait(30)
        shutil.rmtree(place)


class Server:
    """`mlflow server`, which can be ended and started again at the same address."""

    def __init__(self, database: str, artifacts: Path) -> None:
        self.port, self.log = free_port(), artifacts.with_name("server.log")
        self.uri = f"http://127.0.0.1:{self.port}"
        self.words = [
            sys.executable, "-m", "mlflow", "server", "--backend-store-uri", database, "--artifacts-destination",
            artifacts.as_uri(), "--host", "127.0.0.1", "--port", str(self.port), "--workers", "1",
        ]  # fmt: skip
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        quiet = {"MLFLOW_DISABLE_TELEMETRY": "true", "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                self.words, env={**os.environ, **quiet}, start_new_session=True, stdout=log, stderr=log
            )
        until = time.monotonic() + 180
        while time.monotonic() < until:
            try:
                with urllib.request.urlopen(f"{self.uri}/health", timeout=2):
                    return
            except OSError:
                assert self.process.poll() is None, self.log.read_text()[-3000:]
                time.sleep(0.3)
        raise AssertionError("the server does not start")

    def kill(self) -> None:
        assert self.process is not None
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def write(uri: str, number: int, at: threading.Barrier, errors: list[BaseException]) -> None:
    """One writer: a run with parameters, metrics, artifacts and runs inside."""
    try:
        tracker = MlflowTracker(uri, "many")
        at.wait()
        with tracker.run(f"writer {number}") as run:
            run.parameters({"number": number})
            for step in range(ROUNDS):
                run.metrics({"loss": number + step / 10}, step=step)
                run.text(f"notes/{step}.txt", f"{number} {step}")
                with run.run(f"inside {step}") as inner:
                    inner.metrics({"value": step})
                time.sleep(1.0)
    except BaseException as error:
        errors.append(error)


def test_eight_writers_and_a_server_that_goes_away(database: str, tmp_path: Path) -> None:
    import mlflow

    server, errors = Server(database, tmp_path / "artifacts"), list[BaseException]()
    server.start()
    try:
        at = threading.Barrier(WRITERS + 1)
        writers = [threading.Thread(target=write, args=(server.uri, i, at, errors)) for i in range(WRITERS)]
        for writer in writers:
            writer.start()
        at.wait(120)
        time.sleep(3.0)
        server.kill()
        time.sleep(AWAY_S)
        server.start()
        for writer in writers:
            writer.join(300)
        assert not errors, errors

        client = mlflow.MlflowClient(server.uri)
        experiment = client.get_experiment_by_name("many")
        runs = client.search_runs([experiment.experiment_id], max_results=1000)
        for number in range(WRITERS):
            (run,) = [one for one in runs if one.info.run_name == f"writer {number}"]
            assert run.info.status == "FINISHED" and run.data.params["number"] == str(number)
            history = {(m.step, m.value) for m in client.get_metric_history(run.info.run_id, "loss")}
            assert history == {(step, number + step / 10) for step in range(ROUNDS)}
            inside = {o.info.run_name for o in runs if o.data.tags.get("mlflow.parentRunId") == run.info.run_id}
            assert inside == {f"inside {step}" for step in range(ROUNDS)}
            for step in range(ROUNDS):
                path = client.download_artifacts(run.info.run_id, f"notes/{step}.txt", str(tmp_path))
                assert Path(path).read_text() == f"{number} {step}"
    finally:
        server.kill()
