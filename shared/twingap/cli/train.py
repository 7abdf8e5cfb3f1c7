"""`twingap train`: what the diagnosis has learnt, made again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Effects, Json, say_json, wrote
from twingap.cli.progress import progress


def train(
    cache: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where to keep it; default, and where the diagnosis looks: twingap's cache."),
    ] = None,
    effects: Effects = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of everything random; default: the diagnosis's own.", min=0)
    ] = None,
    as_json: Json = False,
) -> None:
    """Learn from simulated gaps what the diagnosis knows (maintainers). An interrupted training is taken up again."""
    with progress("loading") as shown:
        from twingap.gap.knowledge import SEED
        from twingap.gap.knowledge import train as run

        seed = SEED if seed is None else seed
        path = run(cache, seed, shown.share)
    if as_json:
        from twingap.provenance import digest_of_path

        say_json({"path": str(path), "sha256": digest_of_path(path), "seed": seed})
    wrote(path, as_json=as_json)
