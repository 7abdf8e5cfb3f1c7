"""Options that every command spells the same way, and how commands speak."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

Seed = Annotated[int, typer.Option(help="Seed of everything random; same seed, same bytes.", min=0)]
Json = Annotated[bool, typer.Option("--json", help="Print the machine-readable result instead of the table.")]

progress_console = Console(stderr=True)
"""Progress bars go to standard error, so that standard output holds the result alone."""


def show(rows: list[dict[str, Any]], as_json: bool, title: str = "") -> None:
    """Print rows as a table, or as JSON."""
    if as_json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    table = Table(title=title or None)
    for column in rows[0] if rows else ():
        table.add_column(column)
    for row in rows:
        table.add_row(*("" if value is None else str(value) for value in row.values()))
    Console().print(table)


def wrote(*paths: Path, as_json: bool = False) -> None:
    """End a command with the paths of what it wrote."""
    for path in paths:
        print(path, file=sys.stderr if as_json else sys.stdout)
