"""Behaviour of worker processes: their threads, their end, and interruptions."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h


@functools.cache
def end_with(leader: int) -> None:
    """Make this worker end with its leader; otherwise loky's workers survive a killed leader for minutes."""

    def watch() -> None:
        while os.getppid() == leader:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@functools.cache
def keep_memory() -> None:
    """Let glibc keep memory that is freed, up to 64 MB, as it does by itself in a process that nobody tuned.

    dask starts workers with a threshold of 64 kB: every array then comes in new pages, which takes half as long again.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):  # another C library
        mallopt = ctypes.CDLL(None).mallopt
        for parameter, value in ((_M_MMAP_THRESHOLD, 32 << 20), (_M_TRIM_THRESHOLD, 64 << 20)):
            mallopt(parameter, value)


@contextmanager
def limited_threads(threads: int) -> Iterator[None]:
    """Limit the threads of BLAS, OpenMP, torch and numba within the block, also of libraries loaded in it."""
    import joblib
    import threadpoolctl

    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # read when a library is loaded
    before = {name: os.environ.get(name) for name in names}
    torch, numba = sys.modules.get("torch"), sys.modules.get("numba")
    if torch is not None:
        torch_before = torch.get_num_threads()
    else:  # as torch chooses when it is loaded
        stated = before["OMP_NUM_THREADS"] or ""
        torch_before = int(stated) if stated.isdigit() else joblib.cpu_count(only_physical_cores=True)
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
