"""What a benchmark returns, and how it times: rivals in turn, in the same run, so that a noisy machine hits both.

A benchmark is a module of this package with ``measure(quick: bool) -> Measurement``; its name is the module's.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Target:
    """A figure that this project promises.

    Parameters
    ----------
    name : str
        What is promised, with its unit.
    value : float
        What this run measured.
    at_least : float
        The promise. Express "at most" promises as inverse ratios.
    """

    name: str
    value: float
    at_least: float

    @property
    def met(self) -> bool:
        """Whether this run kept the promise."""
        return self.value >= self.at_least


@dataclass(frozen=True)
class Measurement:
    """One benchmark's result.

    Parameters
    ----------
    title : str
        What was compared, on what sizes, in one line.
    rows : sequence of mappings
        The table: one row per rival or setting; same keys in each.
    targets : sequence of Target
    notes : sequence of str
        Floor of the hot path, what was left out and why.
    """

    title: str
    rows: Sequence[Mapping[str, Any]]
    targets: Sequence[Target] = ()
    notes: Sequence[str] = ()


def in_turn(rivals: Mapping[str, Callable[[], object]], rounds: int = 5) -> dict[str, list[float]]:
    """Seconds per call of each rival: one call of each to warm up, then `rounds` rounds of all in turn."""
    for call in rivals.values():
        call()
    seconds: dict[str, list[float]] = {name: [] for name in rivals}
    for _ in range(rounds):
        for name, call in rivals.items():
            begin = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - begin)
    return seconds


def ratio(slow: Sequence[float], fast: Sequence[float]) -> float:
    """Median over rounds of slow / fast, paired round by round."""
    return statistics.median(s / f for s, f in zip(slow, fast, strict=True))
