"""Benchmarks: each against a named peer, in the same run, as ratios.

A benchmark is a module of this package with ``measure(quick: bool) -> Measurement``, or ``measure(quick, seed)``.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil

from benchmarks.harness import Measurement
from twingap.errors import TwingapError


def names() -> tuple[str, ...]:
    """Names of all benchmarks, sorted."""
    found = (module.name for module in pkgutil.iter_modules(__path__))
    return tuple(sorted(name for name in found if name != "harness" and not name.startswith("_")))


def measure(name: str, *, quick: bool = False, seed: int = 0) -> Measurement:
    """Run one benchmark.

    Parameters
    ----------
    name : str
        One of `names()`.
    quick : bool
        Small sizes: shows that it works, not how fast.
    seed : int
        Of its random input, for those that have one.

    Raises
    ------
    TwingapError
        For an unknown name, or a peer that is not installed.
    """
    if name not in names():
        raise TwingapError(f"unknown benchmark {name!r}", mend=f"known: {', '.join(names()) or 'none'}")
    try:
        run = importlib.import_module(f"benchmarks.{name}").measure
        given = {"seed": seed} if "seed" in inspect.signature(run).parameters else {}
        done = run(quick=quick, **given)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in ("twingap", "benchmarks", "papers"):
            raise
        raise TwingapError(
            f"needs {missing}, which is not installed", where=f"benchmark {name}", mend="pip install 'twingap[bench]'"
        ) from error
    assert isinstance(done, Measurement)
    return done
