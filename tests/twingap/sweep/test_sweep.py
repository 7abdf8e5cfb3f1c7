"""Sweeps: the same results whatever the backend and however often interrupted; no job's failure loses another's."""

from __future__ import annotations

import functools
import importlib.util
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from twingap.errors import TwingapError
from twingap.sweep import SweepError, sweep
from twingap.sweep.store import ResultStore, decode, encode

HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def jobs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module of jobs, importable here and in workers."""
    monkeypatch.syspath_prepend(str(HERE))
    import sweep_jobs

    return sweep_jobs


def same(a: Any, b: Any) -> bool:
    """Equal to the last bit, NaN equal to NaN."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and (a == b or (a != a and b != b))


@pytest.mark.parametrize("backend", ["sequential", "loky", "dask"])
def test_every_backend_gives_the_same_in_job_order(jobs: Any, backend: str, tmp_path: Path) -> None:
    if backend == "dask":
        pytest.importorskip("distributed", reason="the dask extra is not installed")
    todo = [jobs.Draw(seed, pause_s=0.05 * (seed == 0)) for seed in (0, 5, 3, 1)]
    results = sweep(jobs.draw, todo, store=tmp_path / "Prüf stand", backend=backend, n_jobs=2)
    assert [r.job for r in results] == todo
    assert all(same(r.value, {**jobs.draw(r.job), "pair": [r.job.seed, "ü"]}) for r in results)


def test_without_shared_memory_one_process_does_all(jobs: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Then joblib has no processes."""
    monkeypatch.delitem(joblib.parallel.BACKENDS, "loky")
    todo = [jobs.Draw(seed) for seed in range(3)]
    assert [r.job for r in sweep(jobs.draw, todo, n_jobs=2)] == todo


def test_what_is_stored_is_not_computed_again(jobs: Any, tmp_path: Path) -> None:
    log = tmp_path / "log"
    todo = [jobs.Draw(seed, str(log)) for seed in range(4)]
    first = sweep(jobs.draw, todo[:2], store=tmp_path / "store", backend="sequential")
    seen: list[tuple[int, str]] = []
    again = sweep(
        jobs.draw,
        [*todo, todo[0]],
        store=tmp_path / "store",
        backend="sequential",
        on_result=lambda r: seen.append((r.job.seed, r.why)),
    )
    assert log.read_text().split() == ["0", "1", "2", "3"]
    assert seen == [(0, ""), (1, ""), (2, "no result"), (3, "no result")]
    assert [r.job.seed for r in again] == [0, 1, 2, 3, 0]
    assert all(same(a.value, b.value) for a, b in zip(first, again, strict=False))


@pytest.mark.parametrize("how", ["kill -9", "ctrl-c"])
def test_a_sweep_that_was_stopped_resumes(jobs: Any, tmp_path: Path, how: str) -> None:
    log, store = tmp_path / "log", tmp_path / "store"
    script = f"""
        import sys
        sys.path.insert(0, {str(HERE)!r})
        from sweep_jobs import Draw, draw
        from twingap.sweep import sweep
        if __name__ == "__main__":
            sweep(draw, [Draw(s, {str(log)!r}, 0.25) for s in range(10)], store={str(store)!r}, n_jobs=2)
    """
    (tmp_path / "go.py").write_text(textwrap.dedent(script))
    child = subprocess.Popen(
        [sys.executable, "go.py"], cwd=tmp_path, start_new_session=True, stderr=subprocess.PIPE, text=True
    )
    while len(list(store.glob("[!.]*.json"))) < 3:
        assert child.poll() is None, child.communicate()[1]
        time.sleep(0.02)
    if how == "kill -9":
        os.kill(child.pid, signal.SIGKILL)
    else:
        os.killpg(child.pid, signal.SIGINT)  # as a terminal does: to all processes in the foreground
    # All its workers end too: they hold this pipe open as long as they live.
    _, said = child.communicate(timeout=20)
    assert said.count("Traceback") <= 1, "workers must not add tracebacks of their own"
    finished = {json.loads(p.read_text())["identity"]["job"]["seed"] for p in store.glob("[!.]*.json")}
    assert 3 <= len(finished) < 10
    log.unlink()
    todo = [jobs.Draw(seed, str(log), 0.25) for seed in range(10)]
    resumed = sweep(jobs.draw, todo, store=store, n_jobs=2)
    assert set(log.read_text().split()) == {str(seed) for seed in range(10)} - {str(seed) for seed in finished}
    whole = sweep(jobs.draw, [jobs.Draw(seed) for seed in range(10)], backend="sequential")
    assert all(same(a.value, b.value) for a, b in zip(resumed, whole, strict=True))
    assert not list(store.glob(".[0-9a-f]*")), "no half-written files are left"


def test_failures_lose_no_other_job_and_run_again(jobs: Any, tmp_path: Path) -> None:
    todo = [{"seed": seed} for seed in range(6)]
    with pytest.raises(SweepError) as caught:
        sweep(jobs.brittle, todo, store=tmp_path, n_jobs=2)
    assert [r.value for r in caught.value.results] == [0, 1, 4, 5]
    assert [f.job["seed"] for f in caught.value.failures] == [2, 3]
    assert "2 of 6 jobs failed: [seed=2], [seed=3]: ValueError: two is not liked" in str(caught.value)
    assert "died" in caught.value.failures[1].error
    assert any("two is\nnot liked" in p.read_text() for p in (tmp_path / "failed").iterdir())
    why: list[str] = []
    with pytest.raises(SweepError):
        sweep(jobs.brittle, todo[:3], store=tmp_path, backend="sequential", on_result=lambda r: why.append(r.why))
    assert why == ["", ""]
    # The same store, the cause mended (another job, since the job is what says so here).
    mended = [{"seed": 3, "dies": False}]
    assert sweep(jobs.brittle, mended, store=tmp_path, backend="sequential")[0].value == 3


def test_what_cannot_be_stored_and_sys_exit_are_failures_too(jobs: Any) -> None:
    with pytest.raises(SweepError, match="set"):
        sweep(jobs.unstorable, [{}], backend="sequential")
    with pytest.raises(SweepError, match="gone"):
        sweep(jobs.leave, [{}], backend="sequential")


def test_it_says_why_a_job_runs_again(jobs: Any, tmp_path: Path) -> None:
    def why(job: Any, **given: Any) -> str:
        options = {"version": "1", "data": {"cwru": "abc"}, "describe": lambda _: "task A"} | given
        return sweep(jobs.draw, [job], store=tmp_path, backend="sequential", **options)[0].why

    assert why(jobs.Draw(1)) == "no result"
    assert why(jobs.Draw(1)) == ""
    assert why(jobs.Draw(2)) == "job changed"
    assert why(jobs.Draw(1), version="2") == "code changed"
    assert why(jobs.Draw(1), data={"cwru": "def"}) == "data changed"
    assert why(jobs.Draw(3), describe=lambda _: "task B") == "no result"
    assert why(jobs.Draw(1), version="2") == ""


@pytest.mark.parametrize("name", ["json", "npz"])
@pytest.mark.parametrize("damage", ["truncated", "empty", "flipped", "gone"])
def test_a_damaged_result_is_computed_again(jobs: Any, tmp_path: Path, name: str, damage: str) -> None:
    first = sweep(jobs.draw, [jobs.Draw(1)], store=tmp_path, backend="sequential")[0]
    path = next(tmp_path.glob(f"*.{name}"))
    held = bytearray(path.read_bytes())
    if damage == "gone":
        path.unlink()
    else:
        held[len(held) // 2] ^= 0x10
        kept = {"truncated": len(held) // 2, "empty": 0, "flipped": len(held)}[damage]
        path.write_bytes(bytes(held[:kept]))
    again = sweep(jobs.draw, [jobs.Draw(1)], store=tmp_path, backend="sequential")[0]
    assert again.why == ("no result" if (name, damage) == ("json", "gone") else "stored result damaged")
    assert same(first.value, again.value)
    assert sweep(jobs.draw, [jobs.Draw(1)], store=tmp_path, backend="sequential")[0].why == ""


@pytest.mark.parametrize("backend", ["loky", "sequential"])
def test_jobs_do_not_oversubscribe_the_machine(jobs: Any, backend: str) -> None:
    results = sweep(jobs.threads_inside, [{"i": 0}, {"i": 1}], backend=backend, n_jobs=2)
    # A BLAS that the job itself loads last may not be listed yet when the limit is set; torch always is.
    assert all(r.value[0] == 1 and min(r.value) == 1 for r in results)


def test_callbacks_come_in_this_process_and_thread(jobs: Any) -> None:
    where: list[tuple[int, int]] = []
    sweep(
        jobs.draw,
        [jobs.Draw(s) for s in range(5)],
        n_jobs=2,
        on_result=lambda _: where.append((os.getpid(), threading.get_ident())),
    )
    assert where == [(os.getpid(), threading.get_ident())] * 5


def test_user_errors_are_one_line(jobs: Any, tmp_path: Path) -> None:
    todo = [jobs.Draw(0)]
    (tmp_path / "file").write_text("")
    cases: list[tuple[str, dict[str, Any]]] = [
        ("unknown backend 'spark'; use one of loky", {"backend": "spark"}),
        ("has no address", {"backend": "loky", "address": "tcp://1.2.3.4:5"}),
        ("n_jobs = 0", {"n_jobs": 0}),
        ("cannot be made", {"store": tmp_path / "file" / "store"}),
    ]
    if importlib.util.find_spec("distributed") is not None:
        cases.append(("no dask scheduler answers", {"backend": "dask", "address": "tcp://127.0.0.1:9"}))
        cases.append(("no dask scheduler answers", {"backend": "dask", "address": "nonsense"}))
    for expected, options in cases:
        with pytest.raises(TwingapError) as caught:
            sweep(jobs.draw, todo, **options)
        assert expected in str(caught.value) and "\n" not in str(caught.value)


def test_two_sweeps_do_not_share_a_store(jobs: Any, tmp_path: Path) -> None:
    with ResultStore(tmp_path).claimed(), pytest.raises(TwingapError, match="another sweep"):
        sweep(jobs.draw, [jobs.Draw(0)], store=tmp_path, backend="sequential")


def test_functions_that_workers_cannot_name_are_refused(jobs: Any) -> None:
    with pytest.raises(TypeError, match="module level"):
        sweep(lambda job: job, [{"a": 1}])
    with pytest.raises(TypeError, match="digests"):
        sweep(functools.partial(jobs.add, offset=2), [{"seed": 1}])
    bound = functools.partial(jobs.add, offset=2)
    assert sweep(bound, [{"seed": 1}], data={"offset": "2"}, n_jobs=1)[0].value == 3


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text()
ARRAYS = hnp.arrays(
    hnp.scalar_dtypes().filter(lambda d: d.kind in "bifcu" and d.itemsize <= 16), hnp.array_shapes(min_side=0)
)
KEYS = st.text().filter(lambda k: k != "$array")


@given(st.recursive(SCALARS | ARRAYS, lambda v: st.lists(v) | st.dictionaries(KEYS, v), max_leaves=8))
@settings(max_examples=60, deadline=None)
def test_values_come_back_as_they_were(value: Any) -> None:
    assert same(decode(*encode(value)), value)


@pytest.mark.parametrize("what", ["value", "array"])
def test_a_result_that_was_edited_is_computed_again(jobs: Any, tmp_path: Path, what: str) -> None:
    first = sweep(jobs.draw, [jobs.Draw(1)], store=tmp_path, backend="sequential")[0]
    if what == "value":
        path = next(tmp_path.glob("*.json"))
        held = json.loads(path.read_text())
        held["value"] = held["value"].replace("[1,", "[2,")
        path.write_text(json.dumps(held))
    else:
        path = next(tmp_path.glob("*.npz"))
        with np.load(path) as archive:
            arrays = {name: archive[name] + 1 for name in archive.files}
        np.savez(path, **arrays)
    again = sweep(jobs.draw, [jobs.Draw(1)], store=tmp_path, backend="sequential")[0]
    assert again.why == "stored result damaged" and same(first.value, again.value)
