"""Jobs for the tests of sweeps, in a module that worker processes can import."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Draw:
    """One job: draw from `seed`, note the call in the file `log`, take `pause_s` for it."""

    seed: int
    log: str = ""
    pause_s: float = 0.0


def draw(job: Draw) -> dict[str, Any]:
    """Numbers, arrays and nesting that depend on the seed alone."""
    if job.log:
        with Path(job.log).open("a") as stream:
            stream.write(f"{job.seed}\n")
    time.sleep(job.pause_s)
    rng = np.random.default_rng(job.seed)
    return {
        "mean": rng.normal(),
        "pair": (job.seed, "ü"),
        "x": rng.normal(size=(3, 4)),
        "deep": [{"ints": rng.integers(9, size=5), "nothing": None, "nan": float("nan")}],
    }


def brittle(job: Mapping[str, Any]) -> int:
    """Raise for seed 2, take the whole process down for seed 3."""
    if job["seed"] == 2:
        raise ValueError("two is\nnot liked")
    if job["seed"] == 3 and job.get("dies", True):
        os.kill(os.getpid(), signal.SIGKILL)
    return int(job["seed"])


def new_pages(_: object) -> int:
    """Pages that the system hands out for arrays that are made and dropped one after the other."""
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(100):
        np.ones(1 << 17)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


def threads_inside(_: object) -> list[int]:
    """Threads that BLAS and torch may use inside a job."""
    import threadpoolctl
    import torch

    _ = np.ones((8, 8)) @ np.ones((8, 8))
    return [torch.get_num_threads(), *(pool["num_threads"] for pool in threadpoolctl.threadpool_info())]


def unstorable(_: object) -> object:
    """Return what no store can hold."""
    return {1, 2}


def leave(_: object) -> None:
    """Call sys.exit, as library code sometimes does."""
    raise SystemExit("gone")


def add(job: Mapping[str, Any], offset: int) -> int:
    """For a partial."""
    return int(job["seed"]) + offset


def level_of(job: Mapping[str, Any]) -> list[Any]:
    """The user's own effect of that name as this process knows it, and the process."""
    import twingap.effects as effects

    return [effects.make_effect(job["name"]).level, os.getpid(), list(effects.catalogue())]  # type: ignore[attr-defined]
