"""Progress of a command on standard error: a bar on a terminal, else lines at intervals."""

from __future__ import annotations

import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress

T = TypeVar("T")

EVERY_S: Final = 30.0
"""Interval of lines where standard error is no terminal, s; shorter stages are not printed there."""

console = Console(stderr=True)
"""Console on standard error, so that standard output contains the result only."""


class Progress(ABC):
    """Current step and progress of a command; its methods are the callbacks of the library."""

    def __init__(self, what: str, total: float | None) -> None:
        self.what, self.done, self.total, self.now = what, 0.0, total, ""

    def share(self, what: str, fraction: float) -> None:
        """Set the current step and the fraction done, 0 to 1."""
        self._set(what, fraction, 1.0, "")

    def count(self, what: str, done: float, total: float | None) -> None:
        """Set the current step, the amount done and the total amount."""
        self._set(what, done, total, "")

    def step(self, now: str = "", amount: float = 1) -> None:
        """Increase the amount done; `now` names the item."""
        self._set(self.what, self.done + amount, self.total, now)

    def _set(self, what: str, done: float, total: float | None, now: str) -> None:
        new = what != self.what
        if new:
            self.end_of_stage()
        self.what, self.done, self.total, self.now = what, done, total, now
        self.show(new)

    @abstractmethod
    def show(self, new: bool) -> None:
        """Show the progress; `new` at the begin of a step."""

    def end_of_stage(self) -> None:  # noqa: B027
        """Called at the end of a step; a bar shows nothing then."""

    def percent(self) -> str:
        """Percentage done; "" when unknown."""
        return f"{100 * min(1.0, self.done / self.total):.0f} %" if self.total else ""


class _Bar(Progress):
    """Progress bar on a terminal."""

    def __init__(self, what: str, total: float | None, bar: RichProgress) -> None:
        super().__init__(what, total)
        self.bar, self.task = bar, bar.add_task(what, total=total, percent="", now="")

    def show(self, new: bool) -> None:
        given: dict[str, Any] = {"percent": self.percent(), "now": self.now}
        self.bar.update(self.task, description=self.what, completed=self.done, total=self.total, **given)


class _Lines(Progress):
    """Progress as lines that a thread prints at intervals."""

    def __init__(self, what: str, total: float | None, every_s: float) -> None:
        super().__init__(what, total)
        self.every_s, self.begin, self.finished = every_s, time.monotonic(), threading.Event()
        self.started = self.begin
        self.thread = threading.Thread(target=self._print_at_intervals, daemon=True)
        self.thread.start()

    def show(self, new: bool) -> None:
        if new:
            self.begin = time.monotonic()

    def end_of_stage(self) -> None:
        seconds = time.monotonic() - self.begin
        if seconds >= self.every_s:
            _print(f"{self.what}: done in {_duration(seconds)}")

    def close(self) -> None:
        """Stop printing."""
        self.finished.set()
        self.thread.join()

    def _print_at_intervals(self) -> None:
        while not self.finished.wait(self.every_s):
            elapsed = f"{_duration(time.monotonic() - self.started)} since the start"
            known = ", ".join(word for word in (self.percent(), self.now, elapsed) if word)
            _print(f"{self.what}: {known}")


@contextmanager
def progress(title: str, total: float | None = None, *, every_s: float = EVERY_S) -> Iterator[Progress]:
    """Show progress within the block.

    Parameters
    ----------
    title : str
        First step.
    total : float or None
        Total amount; None = unknown.
    every_s : float
        Interval of lines where standard error is no terminal, s.

    Yields
    ------
    Progress
    """
    if not console.is_terminal:
        lines = _Lines(title, total, every_s)
        try:
            yield lines
            lines.end_of_stage()
        finally:
            lines.close()
        return
    columns = (
        TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.fields[percent]}"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[now]}", markup=False),
    )  # fmt: skip
    with RichProgress(*columns, console=console, transient=True) as bar:
        yield _Bar(title, total, bar)


def steps(items: Iterable[T], title: str, total: int) -> Iterator[T]:
    """Iterate over items with progress."""
    with progress(title, total) as shown:
        for item in items:
            yield item
            shown.step()


@contextmanager
def resumable(title: str) -> Iterator[Progress]:
    """Show progress of work that can be interrupted and resumed."""
    try:
        with progress(title) as shown:
            yield shown
    except KeyboardInterrupt:  # typer would end without a message
        _print("interrupted; finished results are kept, run the same command to continue")
        raise typer.Exit(130) from None


def _print(line: str) -> None:
    print(f"twingap: {line}", file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
