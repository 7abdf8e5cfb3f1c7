"""A real dask cluster whose parts are killed: the results are those of the local run, and finished work is kept."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import textwrap
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from tests.twingap.sweep.test_sweep import same
from twingap.errors import TwingapError
from twingap.sweep import SweepError, cluster, sweep

HERE = Path(__file__).parent
HAS_DASK = importlib.util.find_spec("distributed") is not None
pytestmark = pytest.mark.skipif(not HAS_DASK, reason="the dask extra is not installed")


@pytest.fixture(autouse=True)
def jobs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module of jobs, importable here and in workers."""
    monkeypatch.syspath_prepend(str(HERE))
    import sweep_jobs

    return sweep_jobs


class Parts:
    """Processes of a cluster: a scheduler at a fixed port, and workers."""

    def __init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, *names: str) -> None:
        """Start the scheduler or workers, by name."""
        for name in names:
            words = (
                ["scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
                if name == "scheduler"
                else ["worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", name]
            )
            command = [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]]
            # Tasks of a worker that died are reported as such at the first death, not at the fourth.
            paths = os.pathsep.join([str(HERE), *sys.path])
            settings = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0", "PYTHONPATH": paths}
            settings["MALLOC_TRIM_THRESHOLD_"] = "65536"  # as dask's nannies set it
            quiet = subprocess.DEVNULL
            self.processes[name] = subprocess.Popen(command, env={**os.environ, **settings}, stdout=quiet, stderr=quiet)

    def kill(self, *names: str) -> None:
        """End processes at once, as kill -9 or a lost machine does."""
        for name in names:
            process = self.processes.pop(name)
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def parts() -> Iterator[Parts]:
    """A scheduler and two workers that have registered."""
    own = Parts()
    own.start("scheduler", "a", "b")
    try:
        until, threads = time.monotonic() + 60, 0
        while threads < 2 and time.monotonic() < until:
            with suppress(TwingapError):
                probe = cluster.Cluster(own.address)
                threads = probe._threads()
                probe.close()
            time.sleep(0.2)
        assert threads == 2
        yield own
    finally:
        own.kill(*own.processes)


def test_killed_client_worker_and_scheduler_lose_only_what_was_in_progress(
    jobs: Any, parts: Parts, tmp_path: Path
) -> None:
    log, store = tmp_path / "log", tmp_path / "store"
    script = f"""
        from sweep_jobs import Draw, draw
        from twingap.sweep import sweep
        todo = [Draw(s, {str(log)!r}, 0.3) for s in range(24)]
        sweep(draw, todo, store={str(store)!r}, backend="dask", address={parts.address!r})
    """
    (tmp_path / "go.py").write_text(textwrap.dedent(script))
    paths = os.pathsep.join([str(HERE), *sys.path])
    client = subprocess.Popen([sys.executable, "go.py"], cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths})
    try:
        while len(list(store.glob("[!.]*.json"))) < 3:
            assert client.poll() is None
            time.sleep(0.02)
    finally:
        client.kill()
        client.wait()
    kept = {path.name for path in store.glob("[!.]*.json")}

    reused, count = [], 0

    def faults(result: Any) -> None:
        nonlocal count
        if not result.why:
            reused.append(result.job.seed)
            return
        count += 1
        if count == 4:
            parts.kill("a")
        elif count == 8:
            parts.kill("scheduler", "b")
            parts.start("scheduler", "c", "d")

    todo = [jobs.Draw(seed, str(log), 0.3) for seed in range(24)]
    got = sweep(jobs.draw, todo, store=store, backend="dask", address=parts.address, on_result=faults)
    assert len(kept) == len(reused) < 12, "what a killed client had stored is not computed again"
    local = sweep(jobs.draw, [jobs.Draw(seed) for seed in range(24)], backend="sequential")
    assert all(same(a.value, b.value) for a, b in zip(got, local, strict=True))
    again = Counter(log.read_text().split())
    assert set(again) == {str(seed) for seed in range(24)}
    # Two workers with two tasks each are lost with the client and with the scheduler, one worker by itself.
    assert sum(again.values()) <= 24 + 4 + 4 + 2
    assert all(again[str(seed)] == 1 for seed in reused)


def test_workers_keep_the_memory_of_dropped_arrays(jobs: Any, parts: Parts) -> None:
    (first, again) = sweep(jobs.new_pages, [{"i": 0}, {"i": 1}], backend="dask", address=parts.address, n_jobs=1)
    pages_of_all = 100 * (1 << 20) / os.sysconf("SC_PAGESIZE")
    assert min(first.value, again.value) < pages_of_all / 10


def test_scheduler_that_does_not_come_back_ends_the_sweep(
    jobs: Any, parts: Parts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 1.0)
    monkeypatch.setattr(cluster.Cluster.__init__, "__defaults__", (None, 1.0))
    workers = [name for name in parts.processes if name != "scheduler"]
    with pytest.raises(TwingapError, match=r"scheduler was lost; what was finished is kept; run the same again"):
        sweep(
            jobs.draw, [jobs.Draw(seed, pause_s=0.2) for seed in range(9)], store=tmp_path, backend="dask",
            address=parts.address, on_result=lambda _: parts.processes and parts.kill("scheduler", *workers),
        )  # fmt: skip
    assert list(tmp_path.glob("[!.]*.json"))


def test_workers_that_are_killed_again_and_again_change_nothing(
    jobs: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    psutil = pytest.importorskip("psutil")
    trimmed, killed = os.environ.get("MALLOC_TRIM_THRESHOLD_"), 0

    def kill_one(_: object) -> None:
        nonlocal killed
        for process in psutil.Process().children():
            with suppress(psutil.NoSuchProcess):  # one killed before, which has not been waited for yet
                if killed < 3 and "spawn_main" in " ".join(process.cmdline()):
                    process.kill()
                    killed += 1
                    return

    todo = [jobs.Draw(seed, pause_s=0.2) for seed in range(10)]
    got = sweep(jobs.draw, todo, store=tmp_path, backend="dask", n_jobs=2, on_result=kill_one)
    local = sweep(jobs.draw, todo, backend="sequential")
    assert killed == 3
    assert all(same(a.value, b.value) for a, b in zip(got, local, strict=True))
    assert os.environ.get("MALLOC_TRIM_THRESHOLD_") == trimmed, "processes started later are not slower"
    assert not capfd.readouterr().err


def test_local_workers_that_have_ended_are_started_anew(jobs: Any) -> None:
    distributed = pytest.importorskip("distributed")
    todo = [jobs.Draw(seed) for seed in range(3)]
    with cluster.local_cluster(1) as address:
        with distributed.Client(address, set_as_default=False) as client:
            client.retire_workers(close_workers=True)
        got = sweep(jobs.draw, todo, backend="dask", address=address)
    local = sweep(jobs.draw, todo, backend="sequential")
    assert all(same(a.value, b.value) for a, b in zip(got, local, strict=True))


def test_job_that_kills_its_workers_is_named(jobs: Any, tmp_path: Path) -> None:
    dask = pytest.importorskip("dask")
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}), pytest.raises(SweepError) as caught:
        sweep(jobs.brittle, [{"seed": seed} for seed in range(6)], store=tmp_path, backend="dask", n_jobs=2)
    assert [r.value for r in caught.value.results] == [0, 1, 4, 5]
    assert [f.job["seed"] for f in caught.value.failures] == [2, 3]
    assert "died" in caught.value.failures[1].error


def test_worker_that_cannot_load_a_job_is_reported(jobs: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs, "here_only", jobs.draw, raising=False)
    monkeypatch.setattr(jobs.draw, "__qualname__", "here_only")
    with pytest.raises(SweepError, match="here_only"):
        sweep(jobs.draw, [jobs.Draw(0)], backend="dask", n_jobs=1)
