"""Tasks on a dask cluster, which survive the loss of workers and of the scheduler.

dask's own futures are used instead of joblib's dask backend: that one takes a cancelled task for a finished one, and
keeps large arguments on single workers, with which they are lost.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import importlib
import importlib.metadata
import logging
import queue
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final

import cloudpickle

from twingap.errors import TwingapError
from twingap.sweep.processes import deaf_to_interrupts, keep_memory

PATIENCE_S: Final = 300.0
"""How long a lost scheduler, or lost workers, are waited for; longer ones outlast slower restarts."""
FIRST_S: Final = 20.0
"""How long the first worker is waited for."""
CONNECT_S: Final = 3.0
"""Time limit of one attempt to reach a scheduler."""
LOOK_S: Final = 1.0
"""Interval at which workers are counted while no task finishes."""


_LEAN: Final = {
    "distributed.nanny.pre-spawn-environ": {},  # set in this process too, whose later processes would be slower
    "distributed.worker.profile.enabled": False,  # takes up to a sixth of a worker's processor time
}
"""Settings of a local cluster's workers."""


class WorkerDiedError(Exception):
    """The workers on which a task ran died, again and again."""


class Cluster:
    """Connection to a dask cluster.

    Parameters
    ----------
    address : str
        Of the scheduler.
    at_once : int or None
        Tasks sent out at a time; None = two for each thread of the workers.
    patience_s : float
        How long a lost scheduler or lost workers are waited for.

    Raises
    ------
    TwingapError
        When no scheduler answers, or it has no workers.
    """

    def __init__(self, address: str, at_once: int | None = None, patience_s: float = PATIENCE_S) -> None:
        self.address, self.at_once, self.patience_s = address, at_once, patience_s
        self._distributed = distributed()
        self._broken = (
            concurrent.futures.CancelledError, asyncio.CancelledError, TimeoutError, OSError,
            self._distributed.client.ClosedClientError,
        )  # fmt: skip
        self._client = self._connected()
        # Workers that were lost a moment ago are being started again.
        until = time.monotonic() + FIRST_S
        while not self._threads() and time.monotonic() < until:
            time.sleep(LOOK_S)
        if not self._threads():
            self.close()
            raise TwingapError("the dask cluster has no workers", where=address, mend=f"dask worker {address}")
        self._check_workers()

    def close(self) -> None:
        """End the connection; tasks that are still at work are dropped by the scheduler."""
        with contextlib.suppress(Exception):
            self._client.close(timeout=CONNECT_S)

    def run(self, task: Callable[..., Any], arguments: Mapping[str, Sequence[Any]]) -> Iterator[tuple[str, Any]]:
        """Results of ``task(*arguments[name])`` with their names, as they finish.

        Tasks that were out when the scheduler was lost are sent again once it is back. A task whose workers died
        several times is run alone after all others.

        Parameters
        ----------
        task : callable
            Importable by the workers.
        arguments : dict
            Name -> arguments, which can be pickled.

        Yields
        ------
        tuple[str, Any]
            Name, and what the task returned, or the exception that ended it: `WorkerDiedError` where its workers died
            also when it ran alone.

        Raises
        ------
        TwingapError
            When the scheduler does not come back, or there are no workers, for `patience_s`.
        """
        died: list[str] = []
        for name, outcome in self._run(task, arguments, list(arguments), self.at_once):
            if isinstance(outcome, WorkerDiedError):
                died.append(name)
            else:
                yield name, outcome
        yield from self._run(task, arguments, died, 1)

    def _run(
        self, task: Callable[..., Any], arguments: Mapping[str, Sequence[Any]], names: list[str], at_once: int | None
    ) -> Iterator[tuple[str, Any]]:
        waiting, out = deque(names), dict[Any, str]()
        finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        limit, seen = at_once or 2 * max(1, self._threads()), time.monotonic()
        try:
            while waiting or out:
                try:
                    while waiting and len(out) < limit:
                        packed = cloudpickle.dumps((task, arguments[waiting[0]]))
                        future = self._client.submit(_call, packed, pure=False)
                        out[future] = waiting.popleft()
                        future.add_done_callback(finished.put)
                    future = finished.get(timeout=LOOK_S)
                    if future not in out:
                        continue
                    outcome = self._outcome(future)
                except queue.Empty:
                    if threads := self._threads():
                        limit, seen = at_once or 2 * threads, time.monotonic()
                    elif time.monotonic() - seen > self.patience_s:
                        raise self._lost("the dask cluster has no workers") from None
                    continue
                except self._broken as error:
                    logging.getLogger(__name__).debug("the scheduler was lost: %r", error)
                    # In the former order, so that what has waited longest runs first.
                    waiting.extendleft(reversed(out.values()))
                    out.clear()
                    self._reconnect()
                    seen = time.monotonic()
                    continue
                yield out.pop(future), outcome
        finally:
            with contextlib.suppress(Exception):
                self._client.cancel(list(out))

    def _check_workers(self) -> None:
        """Refuse workers with another version of twingap, or without it: they would end at the first task."""
        own = importlib.metadata.version("twingap")
        for worker, found in self._client.run(importlib.metadata.version, "twingap", on_error="return").items():
            if found != own:
                self.close()
                what = "is not installed" if isinstance(found, Exception) else f"has version {found}, {own} expected"
                mend = "install the same version of twingap on all machines"
                raise TwingapError(f"twingap {what} on worker {worker}", where=self.address, mend=mend)

    def _outcome(self, future: Any) -> Any:
        """What a task returned or raised; raises one of `_broken` when it was lost with the scheduler."""
        if future.status == "error":
            error = future.exception(timeout=self.patience_s)
            return WorkerDiedError(str(error)) if type(error).__name__ == "KilledWorker" else error
        return future.result(timeout=self.patience_s)

    def _threads(self) -> int:
        """Threads of all workers; 0 while the scheduler does not answer."""
        try:
            return sum(self._client.ncores().values())
        except Exception:  # what a closed connection raises differs between versions of dask
            return 0

    def _connected(self) -> Any:
        try:
            with warnings.catch_warnings(action="ignore"):
                return self._distributed.Client(self.address, timeout=CONNECT_S, set_as_default=False)
        except Exception as error:  # each kind of address has errors of its own
            mend = "start a scheduler there (dask scheduler), or leave the address out"
            raise TwingapError(f"no dask scheduler answers: {error}", where=self.address, mend=mend) from error

    def _reconnect(self) -> None:
        """Connect again to a scheduler that was lost."""
        self.close()
        until = time.monotonic() + self.patience_s
        while True:
            try:
                self._client = self._connected()
                return
            except TwingapError as error:
                if time.monotonic() > until:
                    raise self._lost("the dask scheduler was lost") from error
                time.sleep(LOOK_S)

    def _lost(self, what: str) -> TwingapError:
        mend = "what was finished is kept; run the same again to go on"
        return TwingapError(what, where=self.address, mend=mend)


def _call(packed: bytes) -> Any:
    """Run a task in a worker; it is unpacked here, since a worker that fails to load a message ends without a word."""
    keep_memory()
    task, arguments = cloudpickle.loads(packed)
    return task(*arguments)


@contextmanager
def open_cluster(address: str | None, n_jobs: int | None) -> Iterator[Cluster]:
    """A cluster for the duration of the block.

    Parameters
    ----------
    address : str or None
        Of a scheduler; None starts a cluster on this machine.
    n_jobs : int or None
        Tasks at once; None = as many as the cluster has threads.

    Raises
    ------
    TwingapError
        When dask is not installed, no scheduler answers, or it has no workers.
    """
    _quiet()
    with contextlib.ExitStack() as stack:
        if address is None:
            address, n_jobs = stack.enter_context(local_cluster(n_jobs)), None
        own = Cluster(address, n_jobs)
        stack.callback(own.close)
        yield own


@contextmanager
def local_cluster(n_workers: int | None) -> Iterator[str]:
    """Address of a cluster on this machine, for the duration of the block.

    Parameters
    ----------
    n_workers : int or None
        With one thread each; None = one for each core.

    Raises
    ------
    TwingapError
        When dask is not installed, or its processes do not start.
    """
    start = distributed().LocalCluster
    import dask

    _quiet()
    try:
        with deaf_to_interrupts(), dask.config.set(_LEAN):
            local = start(
                n_workers=n_workers, threads_per_worker=1, dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )  # fmt: skip
    except RuntimeError as error:
        mend = "use the backend loky, or start a cluster and give its address"
        raise TwingapError(f"no dask cluster starts on this machine: {error}", mend=mend) from error
    ended = threading.Event()
    with local:
        threading.Thread(target=_replace_lost_workers, args=(local, ended), daemon=True).start()
        try:
            yield local.scheduler_address
        finally:
            ended.set()


def _replace_lost_workers(local: Any, ended: threading.Event) -> None:
    """Start workers anew whose own watchdog has given up, such as one that was killed while it started."""
    count = len(local.worker_spec)
    while not ended.wait(LOOK_S):
        if len(local.scheduler.workers) < count:
            with contextlib.suppress(Exception):  # the cluster may be closing
                local.scale(count)


def _quiet() -> None:
    """Leave out dask's messages, such as on lost workers."""
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def distributed() -> Any:
    """The package of dask's clusters."""
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise TwingapError("backend dask is not installed", mend="pip install 'twingap[dask]'") from None
