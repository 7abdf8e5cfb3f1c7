"""Options common to all commands, and their output."""

from __future__ import annotations

import contextlib
import io
import json
import math
import sys
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from twingap.errors import TwingapError


def _load(paths: list[Path] | None) -> list[Path] | None:
    """Register the effects and simulators of files before the command begins."""
    if paths:
        from twingap.effects import load_effects

        for path in paths:
            load_effects(path)
    return paths


Seed = Annotated[int, typer.Option(help="Seed of all random numbers; the same seed gives the same bytes.", min=0)]
AnySeed = Annotated[
    int, typer.Option("--seed", help="Accepted by every command; this one has no random numbers.", min=0, hidden=True)
]
"""Option of commands without random numbers, so that scripts can pass --seed to all."""
Json = Annotated[bool, typer.Option("--json", help="Print the machine-readable result instead of the table.")]
TrackingUri = Annotated[
    str | None,
    typer.Option(
        help="Store of runs, as an MLflow address: sqlite:///PATH or http://SERVER. "
        "Default: MLFLOW_TRACKING_URI, else .twingap/mlflow.db here (TWINGAP_HOME moves it).",
        show_default=False,
    ),
]


class Backend(Enum):
    """Where jobs run."""

    loky = "loky"
    dask = "dask"


Where = Annotated[
    Backend,
    typer.Option("--backend", help="Where to run: processes of this machine (loky), or a dask cluster."),
]
Address = Annotated[
    str | None, typer.Option("--address", help="Address of a running dask scheduler.", show_default=False)
]

Effects = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects", metavar="FILE.py", callback=_load, is_eager=True, show_default=False,
        help="Python file that registers your own effects or simulator; repeatable.",
    ),
]  # fmt: skip


def examples(*lines: str) -> str:
    """Examples at the end of a command's help."""
    return "\n\n".join((f"Example{'s' * (len(lines) > 1)}:", *lines))


def show(rows: list[dict[str, Any]], as_json: bool, title: str = "") -> None:
    """Print rows as a table, or as JSON."""
    if as_json:
        say_json(rows)
        return
    _escape_unencodable()
    table = Table(title=title or None)
    for column in rows[0] if rows else ():
        table.add_column(column)
    for row in rows:
        table.add_row(*(_cell(value) for value in row.values()))
    # Cells are data without markup. Output to a file or pipe is not limited to 80 columns.
    wide = {} if sys.stdout.isatty() else {"width": 200}
    Console(markup=False, highlight=False, **wide).print(table)  # type: ignore[arg-type]


def say(*lines: str) -> None:
    """Print lines without formatting."""
    _escape_unencodable()
    for line in lines:
        print(line)


def say_json(value: Any) -> None:
    """Print as standard JSON; see `standard`."""
    _escape_unencodable()
    unicode = (sys.stdout.encoding or "").lower().replace("-", "").startswith("utf")
    print(json.dumps(standard(value), indent=2, ensure_ascii=not unicode, allow_nan=False))


def standard(value: Any) -> Any:
    """A value as standard JSON has it: NaN and infinities as null, NumPy numbers as numbers."""
    from twingap.provenance import plain

    return _finite(plain(value))


def refuse_overwriting(out: Path, *read: Path) -> None:
    """Raise where a command would overwrite its input: a file, or the tables and samples of a record set.

    Raises
    ------
    TwingapError
        When `out` is one of these files.
    """
    if not out.is_file():
        return
    for path in read:
        for file in (path, path / "records.csv", path / "recordset.toml", *_samples(path)):
            if file.is_file() and out.samefile(file):
                raise TwingapError("is read by this command", where=out, mend="name another file with --out")


def _samples(folder: Path) -> Iterator[Path]:
    """Files of samples that a record set's table names; errors of the table are reported when it is read."""
    from twingap.records.table import read_table

    with contextlib.suppress(TwingapError):
        for row in read_table(folder / "records.csv", ("record", "file")):
            yield folder / row.cells["file"].strip()


def wrote(*paths: Path, as_json: bool = False) -> None:
    """Print the paths that a command has written."""
    _escape_unencodable()
    for path in paths:
        print(path, file=sys.stderr if as_json else sys.stdout)


def _cell(value: Any) -> str:
    """Text of a value; numbers with four significant digits."""
    if value is None:
        return ""
    if isinstance(value, float):
        if value.is_integer() and abs(value) < 1e6:
            return f"{value:.0f}"
        return f"{value:.4g}" if abs(value) < 1e5 else f"{value:.3e}" if math.isfinite(value) else str(value)
    return str(value)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _escape_unencodable() -> None:
    """Print characters that an output cannot encode as escapes (\\xfc) instead of raising."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            with contextlib.suppress(io.UnsupportedOperation, ValueError):
                stream.reconfigure(errors="backslashreplace")
