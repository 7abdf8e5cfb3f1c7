"""`twingap data`: the public data sets."""

from __future__ import annotations

import typer

app = typer.Typer(help="Public data sets: list, verify, fetch, export.", no_args_is_help=True)
