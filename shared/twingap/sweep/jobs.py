"""Many independent jobs (task x method x seed) on one machine or a cluster; an interrupted sweep resumes.

jobs --key--> in the store? --yes--> Result
                   no --> worker: function(job) --> parent: store, on_result --> Result

Only the parent writes results and calls back, so `on_result` (logging to a database, a progress bar) never races.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import os
import sys
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.provenance import canonical, digest_of_code, plain
from twingap.sweep.backends import Inside, Pool, open_pool
from twingap.sweep.cluster import WorkerDiedError
from twingap.sweep.processes import deaf_to_interrupts, end_with, limited_threads
from twingap.sweep.store import Identity, ResultStore, decode, encode

if TYPE_CHECKING:
    from twingap.effects.handover import HandedEffects

J = TypeVar("J")
DIED: Final = "its worker process died (killed, out of memory, or crashed in compiled code)"
WORKER_DIED: Final = frozenset({"TerminatedWorkerError", "BrokenProcessPool"})
"""Names of the errors with which joblib reports a dead worker process."""


@dataclass(frozen=True)
class Result(Generic[J]):
    """A finished job.

    Parameters
    ----------
    job : J
    value : Any
        Return value of the function as read from the store: tuples are lists, dataclasses are dicts.
    label : str
        Description of the job.
    key : str
        Its key in the store.
    seconds : float
        Runtime in the run that computed it, s.
    why : str
        Reason for running it now; "" when it was taken from the store.
    """

    job: J
    value: Any
    label: str
    key: str
    seconds: float
    why: str


@dataclass(frozen=True)
class Failure(Generic[J]):
    """A job that raised or whose worker died."""

    job: J
    label: str
    error: str
    traceback: str


class SweepError(TwingapError):
    """Some jobs failed; all others have finished and their results are stored.

    Attributes
    ----------
    results : list[Result]
        The jobs that succeeded, in job order.
    failures : list[Failure]
    """

    def __init__(self, failures: list[Failure[Any]], results: list[Result[Any]], folder: Path | None) -> None:
        self.failures, self.results = failures, results
        names = ", ".join(f"[{f.label}]" for f in failures[:3]) + (", ..." if len(failures) > 3 else "")
        mend = "mend the cause and run again: only these jobs will run"
        if folder is not None:
            mend = f"tracebacks are in {folder / 'failed'}; {mend}"
        total = len(failures) + len(results)
        super().__init__(f"{len(failures)} of {total} jobs failed: {names}: {failures[0].error}", mend=mend)


def sweep(
    function: Callable[[J], Any],
    jobs: Sequence[J],
    *,
    store: str | os.PathLike[str] | None = None,
    backend: str = "loky",
    address: str | None = None,
    n_jobs: int | None = None,
    threads: int = 1,
    version: str | None = None,
    data: Mapping[str, str] | None = None,
    on_result: Callable[[Result[J]], None] | None = None,
    describe: Callable[[J], str] | None = None,
) -> list[Result[J]]:
    """Run `function` on every job in parallel, reusing results in the store.

    Parameters
    ----------
    function : callable
        Function of one job. Defined at module level, so that workers can import it; `functools.partial` may bind
        further arguments, whose digests then belong in `data`. It returns numbers, text, arrays, or lists and dicts of
        them, depends only on its arguments (seeds are part of the job), and does not log.
    jobs : sequence
        Frozen dataclasses or mappings of JSON values. A job that appears twice runs once.
    store : path-like, optional
        Folder of results; None = results are not stored.
    backend, address, n_jobs
        Where to run; see `twingap.sweep.backends.open_pool`.
    threads : int
        Threads that one job may use; 1 makes results independent of the number of cores.
    version : str, optional
        Version of the code: results of another version are not reused. Default: digest of the module of `function`;
        when more code matters, pass ``digest_of_code(...)`` of all of it.
    data : mapping, optional
        Name -> digest of all data that `function` reads besides its job. A digest of the user's own effects is added.
    on_result : callable, optional
        Called in this process for each result as it becomes available, those from the store first.
    describe : callable, optional
        Description of a job, for progress and errors; a job with the same description and other content has "changed".

    Returns
    -------
    list[Result]
        In the order of `jobs`, the same whether or not the sweep was interrupted in between.

    Raises
    ------
    SweepError
        When jobs failed, after all the others have finished.
    TwingapError
        For an unavailable backend, or a store that cannot be used.
    """
    name, version = _name(function), version or digest_of_code(_bare(function))
    if isinstance(function, functools.partial) and not data:
        raise TypeError("a partial binds data that the results depend on: pass their digests as data={name: digest}")
    plan: dict[str, _Planned[J]] = {}
    keys = []
    own = _handed_effects()
    read = dict(data or {}) | ({} if own is None or not own.digest else {"own effects": own.digest})
    for job in jobs:
        identity = Identity(name, plain(job), version, read)
        keys.append(identity.key)
        plan.setdefault(identity.key, _Planned(job, (describe or in_words)(job), identity))

    kept = None if store is None else ResultStore(store)
    with contextlib.nullcontext() if kept is None else kept.claimed():
        done: dict[str, Result[J]] = {}
        failures: dict[str, Failure[J]] = {}
        for key, item in plan.items():
            if kept is not None and (held := kept.read(key)) is not None:
                done[key] = Result(item.job, held[0], item.label, key, held[1], "")
                if on_result is not None:
                    on_result(done[key])
        todo = {key: item for key, item in plan.items() if key not in done}
        why = {key: kept.why_missing(i.label, i.identity) if kept else "no result" for key, i in todo.items()}
        if todo:
            with open_pool(backend, address, n_jobs, threads) as pool:
                for key, outcome in _outcomes(pool, own, function, {key: item.job for key, item in todo.items()}):
                    item = todo[key]
                    if isinstance(outcome, _Raised):
                        failures[key] = Failure(item.job, item.label, outcome.error, outcome.traceback)
                        if kept is not None:
                            kept.write_failure(item.label, key, outcome.traceback)
                        continue
                    if kept is not None:
                        kept.write(item.label, item.identity, outcome.text, outcome.arrays, outcome.seconds)
                    value = decode(outcome.text, outcome.arrays)
                    done[key] = Result(item.job, value, item.label, key, outcome.seconds, why[key])
                    if on_result is not None:
                        on_result(done[key])
    if failures:
        in_order = [failures[key] for key in plan if key in failures]
        raise SweepError(in_order, [done[key] for key in plan if key in done], kept.folder if kept else None)
    return [done[key] for key in keys]


def in_words(job: object) -> str:
    """Description of a job by its fields: ``task=0->2, seed=1``."""
    table = plain(job)
    if not isinstance(table, Mapping):
        return str(table)
    return ", ".join(f"{key}={value if isinstance(value, str) else canonical(value)}" for key, value in table.items())


@dataclass(frozen=True)
class _Planned(Generic[J]):
    job: J
    label: str
    identity: Identity


@dataclass(frozen=True)
class _Returned:
    text: str
    arrays: dict[str, NDArray[Any]]
    seconds: float


@dataclass(frozen=True)
class _Raised:
    error: str
    traceback: str


def _attempt(
    effects: HandedEffects | None, key: str, function: Callable[[Any], Any], job: Any, inside: Inside
) -> tuple[str, _Returned | _Raised]:
    """Run one job in a worker. Exceptions are returned as text, as not every exception can be pickled."""
    if inside.leader is not None:
        end_with(inside.leader)
    begin = time.perf_counter()
    try:
        if effects is not None:
            effects.check()
        with contextlib.nullcontext() if inside.threads is None else limited_threads(inside.threads):
            value = function(job)
        text, arrays = encode(value)
    except (Exception, SystemExit) as error:
        return key, _Raised(_line(error), traceback.format_exc())
    return key, _Returned(text, arrays, time.perf_counter() - begin)


def _outcomes(
    pool: Pool, effects: HandedEffects | None, function: Callable[[J], Any], jobs: Mapping[str, J]
) -> Iterator[tuple[str, _Returned | _Raised]]:
    """Outcome of each job as it finishes. When a worker dies, the jobs in progress are run again one by one.

    A dead worker aborts all jobs that run in parallel and does not identify the one that killed it. Run alone, that
    job is identified, and jobs that failed only because many together ran out of memory succeed.
    """
    if pool.cluster is not None:
        yield from _on_cluster(pool, effects, function, jobs)
        return
    waiting = deque(jobs)
    while waiting:
        under_way: set[str] = set()
        try:
            yield from _parallel(pool, effects, function, jobs, waiting, under_way)
        except WorkerDiedError:
            for key in [key for key in jobs if key in under_way]:
                try:
                    yield from _parallel(pool, effects, function, jobs, deque([key]), set())
                except WorkerDiedError as error:
                    yield key, _Raised(DIED, f"{DIED}\n{error.__cause__!r}")


def _on_cluster(
    pool: Pool, effects: HandedEffects | None, function: Callable[[J], Any], jobs: Mapping[str, J]
) -> Iterator[tuple[str, _Returned | _Raised]]:
    """Outcome of each job as it finishes on a dask cluster."""
    assert pool.cluster is not None
    arguments = {key: (effects, key, function, job, pool.inside) for key, job in jobs.items()}
    for key, outcome in pool.cluster.run(_attempt, arguments):
        if isinstance(outcome, WorkerDiedError):
            yield key, _Raised(DIED, f"{DIED}\n{outcome}")
        elif isinstance(outcome, BaseException):  # the worker could not load the job
            yield key, _Raised(_line(outcome), "".join(traceback.format_exception(outcome)))
        else:
            yield outcome


def _line(error: BaseException) -> str:
    """An error in one line."""
    line = str(error) if isinstance(error, TwingapError) else f"{type(error).__name__}: {error}"
    return " ".join(line.split())[:500]


def _parallel(
    pool: Pool,
    effects: HandedEffects | None,
    function: Callable[[J], Any],
    jobs: Mapping[str, J],
    waiting: deque[str],
    under_way: set[str],
) -> Iterator[tuple[str, _Returned | _Raised]]:
    """Outcomes of the waiting jobs; those sent but not returned are in progress."""
    if pool.backend == "sequential":
        while waiting:
            key = waiting.popleft()
            yield _attempt(None, key, function, jobs[key], pool.inside)
        return
    import joblib

    def tasks() -> Iterator[Any]:
        while waiting:
            key = waiting.popleft()
            under_way.add(key)
            yield joblib.delayed(_attempt)(effects, key, function, jobs[key], pool.inside)

    # One job at a time per worker and a short queue, so that little is lost when a worker dies.
    # Only this process handles an interruption: workers that are still starting would each print a traceback.
    with deaf_to_interrupts():
        outcomes = joblib.Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")(tasks())
    try:
        while True:
            try:
                key, outcome = next(outcomes)
            except StopIteration:
                return
            except Exception as error:
                if type(error).__name__ in WORKER_DIED:
                    raise WorkerDiedError from error
                raise _backend_failed(pool, error) from error
            under_way.discard(key)
            yield key, outcome
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the warning that jobs in progress are dropped is expected
            outcomes.close()


def _handed_effects() -> HandedEffects | None:
    """The user's own effects; None without any effects module loaded, which saves workers its import."""
    if "twingap.effects" not in sys.modules and not importlib.metadata.entry_points(group="twingap.effects"):
        return None
    from twingap.effects.handover import handed_effects

    return handed_effects()


def _backend_failed(pool: Pool, error: Exception) -> TwingapError:
    line = f"{type(error).__name__}: {error}"[:300]
    mend = "what was finished is kept; run the same again to go on"
    return TwingapError(line, where=f"backend {pool.backend}", mend=mend)


def _bare(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function inside a partial."""
    return _bare(function.func) if isinstance(function, functools.partial) else function


def _name(function: Callable[..., Any]) -> str:
    """Qualified name of a module-level function."""
    bare = _bare(function)
    name = getattr(bare, "__qualname__", "<lambda>")
    if "<" in name:
        raise TypeError(f"{name}: workers can only import a function that is defined at module level")
    module = bare.__module__
    if module == "__main__":
        # The same script has another module name when imported; its file name is the same.
        module = Path(getattr(sys.modules["__main__"], "__file__", None) or "__main__").stem
    return f"{module}.{name}"
