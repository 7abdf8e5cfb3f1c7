"""Backends for independent tasks: this process, local processes or a dask cluster, all through joblib."""

from __future__ import annotations

import contextlib
import functools
import importlib
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

from twingap.errors import TwingapError

Backend = Literal["loky", "threading", "sequential", "dask"]
BACKENDS: Final[tuple[str, ...]] = get_args(Backend)

WORKER_DIED: Final = frozenset({"TerminatedWorkerError", "BrokenProcessPool", "KilledWorker"})
"""Names of the errors with which joblib and dask report a dead worker process."""


@dataclass(frozen=True)
class Pool:
    """An open backend.

    Parameters
    ----------
    backend : str
    n_jobs : int
        Number of parallel tasks.
    threads_inside : int or None
        Thread limit that each task must set itself; None where the pool has set it already.
    leader : int or None
        Id of the process with which local workers must end.
    """

    backend: str
    n_jobs: int
    threads_inside: int | None
    leader: int | None = None


@contextmanager
def open_pool(backend: str, address: str | None, n_jobs: int | None, threads: int) -> Iterator[Pool]:
    """Open a backend for the duration of the block.

    Parameters
    ----------
    backend : {"loky", "threading", "sequential", "dask"}
        loky: local processes.
    address : str or None
        Address of a running dask cluster; None starts one on this machine.
    n_jobs : int or None
        Number of parallel tasks; None = all cores (of the cluster).
    threads : int
        Threads that each task may use inside (BLAS, OpenMP, torch, numba).

    Raises
    ------
    TwingapError
        For an unknown backend, a library that is not installed, or a cluster that does not respond.
    """
    if backend not in BACKENDS:
        raise TwingapError(f"unknown backend {backend!r}", mend=f"use one of {', '.join(BACKENDS)}")
    if address is not None and backend != "dask":
        raise TwingapError(f"backend {backend!r} has no address ({address!r} given)", mend="use dask, or no address")
    if n_jobs is not None and n_jobs < 1:
        raise TwingapError(f"n_jobs = {n_jobs}, at least 1 expected")
    if backend == "dask":
        with _dask(address, n_jobs) as count:
            yield Pool(backend, count, threads)
        return
    import joblib

    count = n_jobs or joblib.cpu_count()
    if backend == "loky" and count > 1:
        with joblib.parallel_config(backend="loky", n_jobs=count, inner_max_num_threads=threads):
            yield Pool("loky", count, None, os.getpid())
        return
    with limited_threads(threads):
        if backend == "threading":
            with joblib.parallel_config(backend="threading", n_jobs=count):
                yield Pool("threading", count, None)
        else:
            yield Pool("sequential", 1, None)


@functools.cache
def end_with(leader: int) -> None:
    """Make this worker end with its leader; otherwise loky's workers survive a killed leader for minutes."""

    def watch() -> None:
        while os.getppid() == leader:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def limited_threads(threads: int) -> Iterator[None]:
    """Limit the threads of BLAS, OpenMP, torch and numba within the block, also of libraries loaded in it."""
    import joblib
    import threadpoolctl

    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # read when a library is loaded
    before = {name: os.environ.get(name) for name in names}
    torch, numba = sys.modules.get("torch"), sys.modules.get("numba")
    torch_before = joblib.cpu_count(only_physical_cores=True) if torch is None else torch.get_num_threads()
    numba_before = None if numba is None else numba.get_num_threads()
    os.environ.update(dict.fromkeys(names, str(threads)))
    try:
        if torch is not None:
            torch.set_num_threads(threads)
        if numba is not None:
            numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
        with threadpoolctl.threadpool_limits(threads):
            yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if numba is not None:
            numba.set_num_threads(numba_before)
        if (torch := sys.modules.get("torch")) is not None:
            torch.set_num_threads(torch_before)


@contextmanager
def _dask(address: str | None, n_jobs: int | None) -> Iterator[int]:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise TwingapError("backend dask is not installed", mend="pip install 'dask[distributed]'") from None
    import joblib

    logging.getLogger("distributed").setLevel(logging.ERROR)
    with contextlib.ExitStack() as stack:
        if address is None:
            count = n_jobs or joblib.cpu_count()
            with deaf_to_interrupts():
                local = distributed.LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None)
            address = stack.enter_context(local).scheduler_address
        try:
            client = stack.enter_context(distributed.Client(address, timeout=3))
        except (OSError, TimeoutError, ValueError) as error:
            mend = "start a scheduler there (dask scheduler), or leave the address out"
            raise TwingapError(f"no dask scheduler answers: {error}", where=address, mend=mend) from error
        cores = sum(client.ncores().values())
        if cores == 0:
            raise TwingapError("the dask cluster has no workers", where=address, mend=f"dask worker {address}")
        with joblib.parallel_config(backend="dask", n_jobs=n_jobs or cores):
            yield n_jobs or cores


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Processes started within the block ignore Ctrl-C, so that this process handles it and ends them in order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
