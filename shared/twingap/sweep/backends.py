"""Backends for independent tasks: this process, local processes through joblib, or a dask cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, Literal, get_args

from twingap.errors import TwingapError
from twingap.sweep.cluster import Cluster, open_cluster
from twingap.sweep.processes import limited_threads

Backend = Literal["loky", "sequential", "dask"]
BACKENDS: Final[tuple[str, ...]] = get_args(Backend)


@dataclass(frozen=True)
class Inside:
    """What a task does before it starts.

    Parameters
    ----------
    threads : int or None
        Thread limit that it sets itself; None where the pool has set it already.
    leader : int or None
        Id of the process with which local workers must end.
    """

    threads: int | None = None
    leader: int | None = None


@dataclass(frozen=True)
class Pool:
    """An open backend.

    Parameters
    ----------
    backend : str
    inside : Inside
    cluster : Cluster or None
        Of the backend dask.
    """

    backend: str
    inside: Inside
    cluster: Cluster | None = None


@contextmanager
def open_pool(backend: str, address: str | None, n_jobs: int | None, threads: int) -> Iterator[Pool]:
    """Open a backend for the duration of the block.

    Parameters
    ----------
    backend : {"loky", "sequential", "dask"}
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
        with open_cluster(address, n_jobs) as cluster:
            yield Pool("dask", Inside(threads), cluster)
        return
    import joblib

    try:
        count = n_jobs or joblib.cpu_count()
    except ValueError as error:
        raise TwingapError(f"{error}, a whole number expected", where="LOKY_MAX_CPU_COUNT") from error
    # Without shared memory, as in some containers, joblib has no processes, and says so.
    if backend == "loky" and count > 1 and "loky" in joblib.parallel.BACKENDS:
        with joblib.parallel_config(backend="loky", n_jobs=count, inner_max_num_threads=threads):
            yield Pool("loky", Inside(leader=os.getpid()))
        return
    with limited_threads(threads):
        yield Pool("sequential", Inside())
