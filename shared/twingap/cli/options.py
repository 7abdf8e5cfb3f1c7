"""Options that every command spells the same way, and how commands speak."""

from __future__ import annotations

import contextlib
import io
import json
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from twingap.errors import TwingapError

T = TypeVar("T")


class Step(Protocol):
    """Moves a bar on by one, with a word on what was done."""

    def __call__(self, now: str = "") -> None: ...


Seed = Annotated[int, typer.Option(help="Seed of everything random; same seed, same bytes.", min=0)]
AnySeed = Annotated[
    int, typer.Option("--seed", help="Taken by every command; nothing is random in this one.", min=0, hidden=True)
]
"""For commands without anything random: a script may pass --seed to all."""
Json = Annotated[bool, typer.Option("--json", help="Print the machine-readable result instead of the table.")]
TrackingUri = Annotated[
    str | None,
    typer.Option(
        help="Where runs are kept, as MLflow writes it: sqlite:///PATH or http://SERVER. "
        "Default: MLFLOW_TRACKING_URI, else .twingap/mlflow.db here (TWINGAP_HOME moves it).",
        show_default=False,
    ),
]

progress_console = Console(stderr=True)
"""Progress bars go to standard error, so that standard output holds the result alone."""


def show(rows: list[dict[str, Any]], as_json: bool, title: str = "") -> None:
    """Print rows as a table, or as JSON."""
    if as_json:
        say_json(rows)
        return
    _speak_any_alphabet()
    table = Table(title=title or None)
    for column in rows[0] if rows else ():
        table.add_column(column)
    for row in rows:
        table.add_row(*(_cell(value) for value in row.values()))
    # Cells hold data, never markup; what goes into a file or a pipe is not squeezed into 80 columns.
    wide = {} if sys.stdout.isatty() else {"width": 200}
    Console(markup=False, highlight=False, **wide).print(table)  # type: ignore[arg-type]


def say(*lines: str) -> None:
    """Print lines as they are."""
    _speak_any_alphabet()
    for line in lines:
        print(line)


def say_json(value: Any) -> None:
    """Print as JSON that any parser takes: NaN and infinities as null, NumPy numbers as numbers."""
    from twingap.provenance import plain

    _speak_any_alphabet()
    unicode = (sys.stdout.encoding or "").lower().replace("-", "").startswith("utf")
    print(json.dumps(_finite(plain(value)), indent=2, ensure_ascii=not unicode, allow_nan=False))


def refuse_overwriting(out: Path, *read: Path) -> None:
    """Refuse to write over what the command reads: a file, or the tables and samples of a record set's folder.

    Raises
    ------
    TwingapError
    """
    if not out.is_file():
        return
    for path in read:
        for file in (path, path / "records.csv", path / "recordset.toml", *_samples(path)):
            if file.is_file() and out.samefile(file):
                raise TwingapError("is read by this command", where=out, mend="name another file with --out")


def _samples(folder: Path) -> Iterator[Path]:
    """Files of samples that a record set's folder names; whether its table is right is found out when it is read."""
    import csv

    table = folder / "records.csv"
    if not table.is_file():
        return
    with table.open(encoding="utf-8-sig", errors="replace", newline="") as lines, contextlib.suppress(csv.Error):
        for row in csv.DictReader(lines):
            if row.get("file"):
                yield folder / str(row["file"]).strip()


def wrote(*paths: Path, as_json: bool = False) -> None:
    """End a command with the paths of what it wrote."""
    _speak_any_alphabet()
    for path in paths:
        print(path, file=sys.stderr if as_json else sys.stdout)


@contextmanager
def progress(title: str, total: int | None = None) -> Iterator[Step]:
    """A bar on standard error, silent where that is not a terminal.

    Parameters
    ----------
    title : str
    total : int or None
        Steps; None when not known.

    Yields
    ------
    Step
        To be called once per step.
    """
    columns = (
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(), TextColumn("{task.fields[now]}", markup=False),
    )  # fmt: skip
    quiet = not progress_console.is_terminal
    with Progress(*columns, console=progress_console, transient=True, disable=quiet) as bar:
        task = bar.add_task(title, total=total, now="")

        def step(now: str = "") -> None:
            bar.update(task, advance=1, now=now)

        yield step


def steps(items: Iterable[T], title: str, total: int) -> Iterator[T]:
    """The items as they come, each a step of a bar like that of `progress`."""
    with progress(title, total) as step:
        for item in items:
            yield item
            step()


def _cell(value: Any) -> str:
    """A value for people: numbers to four digits that count."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e5 else f"{value:.3e}" if math.isfinite(value) else str(value)
    return str(value)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _speak_any_alphabet() -> None:
    """Let a terminal or pipe that lacks a letter get its escape (\\xfc) rather than end the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            with contextlib.suppress(io.UnsupportedOperation, ValueError):
                stream.reconfigure(errors="backslashreplace")
