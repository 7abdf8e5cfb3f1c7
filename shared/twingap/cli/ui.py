"""`twingap ui`: the tracking UI on the runs made here."""

from __future__ import annotations

import contextlib
import sys
from typing import Annotated

import typer

from twingap.cli.options import AnySeed, Effects, TrackingUri, say
from twingap.errors import TwingapError


def ui(
    port: Annotated[int, typer.Option(help="Port to serve at.", min=1, max=65535)] = 5000,
    host: Annotated[str, typer.Option(help="Address to serve at; 0.0.0.0 lets other machines in.")] = "127.0.0.1",
    tracking_uri: TrackingUri = None,
    effects: Effects = None,
    seed: AnySeed = 0,
) -> None:
    """Show the runs made here in the MLflow UI, until Ctrl-C."""
    from twingap.track import tracking_uri as store
    from twingap.track.server import serving

    uri = store(tracking_uri)
    if uri.startswith(("http://", "https://")):
        say(f"the runs are on a tracking server; open {uri}")
        return
    with contextlib.suppress(KeyboardInterrupt), serving(uri, host, port) as server:
        say(f"runs of {uri}", f"{_address(uri, host, port)}   (Ctrl-C ends it)")
        sys.stdout.flush()
        server.wait()
        raise TwingapError("the UI ended by itself", where=uri, mend="start it again")


def _address(uri: str, host: str, port: int) -> str:
    """Address of the latest run's experiment in the UI; of its first page where the store does not tell."""
    from twingap.track.server import latest_experiment, reached
    from twingap.track.store import sqlite_path

    database = sqlite_path(uri)
    experiment = None if database is None else latest_experiment(database)
    page = "" if experiment is None else f"/#/experiments/{experiment}/runs"
    return f"http://{reached(host)}:{port}{page}"
