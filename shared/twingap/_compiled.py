"""Compilation of inner loops by numba, kept on disk where a folder can be written, else in memory for this process."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, cast

import numba

Function = Callable[..., Any]

_log = logging.getLogger(__name__)


def njit(**options: Any) -> Callable[[Function], Function]:
    """Decorator that compiles a function when it is first called.

    What is compiled goes into numba's cache: ``NUMBA_CACHE_DIR``, ``__pycache__`` beside the module, or the user's
    cache folder. Where none of them can be written, as in a container with a read-only file system, each process
    compiles anew; numba by itself fails there.

    The first call in a fresh environment waits for numba's type inference, not for machine code. A kernel is quick to
    compile when it has scalars, indices and plain loops only: each ``np.empty``, ``min``, ``argmax`` or slice takes a
    tenth of a second, assigning one slice to another three seconds. Work space is therefore passed in.

    Parameters
    ----------
    **options
        Of `numba.njit`. The interpreter lock is released unless ``nogil=False``, and a division by zero gives infinity
        or NaN unless ``error_model="python"``: checks of divisions take longer to compile.

    Returns
    -------
    callable
        The decorator.
    """
    options = {"nogil": True, "no_cfunc_wrapper": True, "error_model": "numpy"} | options

    def decorate(function: Function) -> Function:
        if numba.config.DISABLE_JIT:
            return function
        compiled: Any = numba.njit(**options)(function)
        try:
            compiled.enable_caching()
        except RuntimeError as error:  # no folder for it can be written
            _log.debug("%s: compiled in memory", error)
        return cast(Function, compiled)

    return decorate
