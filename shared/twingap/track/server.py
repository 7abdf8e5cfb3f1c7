"""The MLflow UI as a child process that ends with a `with` block."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from twingap.errors import TwingapError
from twingap.track.database import check_database, explained
from twingap.track.store import sqlite_path, state_folder

PATIENCE_S = 180.0


def runs_in(database: Path) -> int:
    """Number of runs in an SQLite store, 0 without a store; deleted runs do not count.

    Raises
    ------
    TwingapError
        When the file is not a tracking store.
    """
    if not database.exists():
        return 0
    check_database(database, write=False)
    try:
        with contextlib.closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as connection:
            (count,) = connection.execute("SELECT count(*) FROM runs WHERE lifecycle_stage = 'active'").fetchone()
            return int(count)
    except sqlite3.Error as error:
        if "no such table" in str(error):
            raise TwingapError(f"is no tracking store: {error}", where=database, mend="check --tracking-uri") from error
        raise explained(error, database) from error


def latest_experiment(database: Path) -> str | None:
    """Id of the experiment with the latest run in an SQLite store; None without runs."""
    with contextlib.closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as connection:
        found = connection.execute(
            "SELECT experiment_id FROM runs WHERE lifecycle_stage = 'active' ORDER BY start_time DESC LIMIT 1"
        ).fetchone()
    return None if found is None else str(found[0])


@contextmanager
def serving(uri: str, host: str, port: int, *, need_runs: bool = True) -> Iterator[subprocess.Popen[bytes]]:
    """Serve the store at `uri`; yield the server's process once it responds, and end it with the block.

    Parameters
    ----------
    uri : str
        ``sqlite:///...`` or another database. Its artifacts are served too.
    host : str
        Address to bind to.
    port : int
    need_runs : bool
        Whether an SQLite store without runs is an error.

    Raises
    ------
    TwingapError
        When there are no runs, the port is in use, the address is not this machine's, or the server does not start.
    """
    database = sqlite_path(uri)
    if database is not None:
        if need_runs and runs_in(database) == 0:
            mend = "make one with twingap run or twingap bench, or name another store with --tracking-uri"
            raise TwingapError("no runs here yet", where=database, mend=mend)
        uri = f"sqlite:///{database}"
    _check_free(host, port)
    home = state_folder() if database is None else database.parent
    options = {
        "backend-store-uri": uri, "artifacts-destination": (home / "artifacts").as_uri(),
        "host": host, "port": str(port), "workers": "1",
    }  # fmt: skip
    command = [sys.executable, "-m", "mlflow", "server", *(f"--{key}={value}" for key, value in options.items())]
    # MLflow's scheduler of evaluation jobs is not needed; neither is telemetry.
    quiet = {"MLFLOW_DISABLE_TELEMETRY": "true", "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    with tempfile.TemporaryFile() as log:
        server = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
            env={**quiet, **os.environ},
            start_new_session=True,  # Ctrl-C reaches this process only, which then ends the server and its workers
        )  # fmt: skip
        try:
            with _ending_on_terminate():
                if not _answers(server, host, port):
                    log.seek(0)
                    lines = [line for line in log.read().decode(errors="replace").splitlines() if line.strip()]
                    if server.poll() is None:
                        raise TwingapError(
                            f"the UI has not answered for {PATIENCE_S:g} s", where=uri,
                            mend="try again when this machine is less busy",
                        )  # fmt: skip
                    raise TwingapError(
                        f"the UI does not start: {lines[-1][:300] if lines else 'it printed nothing'}", where=uri
                    )
                yield server
        finally:
            _end(server)


def reached(host: str) -> str:
    """Host within an address at which a server that is bound to `host` is reached from this machine."""
    return {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)


def _check_free(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        # As servers do: a port that another server has just released is free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            taken = isinstance(error, PermissionError) or "in use" in str(error)
            mend = f"choose another with --port, {port + 1} say" if taken else "choose an address of this machine"
            raise TwingapError(f"cannot serve there: {error.strerror}", where=f"{host}:{port}", mend=mend) from error


def _answers(server: subprocess.Popen[bytes], host: str, port: int) -> bool:
    """Wait until the server responds; False when it ended or timed out."""
    until = time.monotonic() + PATIENCE_S
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    while server.poll() is None and time.monotonic() < until:
        try:
            with direct.open(f"http://{reached(host)}:{port}/health", timeout=2):
                return True
        except (urllib.error.URLError, OSError):
            time.sleep(0.2)
    return False


def _end(server: subprocess.Popen[bytes]) -> None:
    """End the server and its workers: SIGTERM first, SIGKILL after ten seconds."""
    for number, patience in ((signal.SIGTERM, 10), (signal.SIGKILL, 10)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(server.pid, number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            server.wait(patience)
            break
    with contextlib.suppress(ProcessLookupError):
        os.killpg(server.pid, signal.SIGKILL)  # a worker that is still running


@contextmanager
def _ending_on_terminate() -> Iterator[None]:
    """Handle SIGTERM and a closed terminal like Ctrl-C, so that the server ends too."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
