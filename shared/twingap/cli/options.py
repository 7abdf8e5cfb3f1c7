"""Options that every command spells the same way, and how commands speak."""

from __future__ import annotations

import contextlib
import io
import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from twingap.errors import TwingapError


def _load(paths: list[Path] | None) -> list[Path] | None:
    """Register the effects of the files, before the command begins."""
    if paths:
        from twingap.effects import load_effects

        for path in paths:
            load_effects(path)
    return paths


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

Effects = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects", metavar="FILE.py", callback=_load, is_eager=True, show_default=False,
        help="Effects of your own: a Python file that registers them. May be given several times.",
    ),
]  # fmt: skip


def examples(*lines: str) -> str:
    """The end of a command's help."""
    return "\n\n".join((f"Example{'s' * (len(lines) > 1)}:", *lines))


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
