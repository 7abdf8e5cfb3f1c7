"""`twingap train`: what the diagnosis has learnt, made again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Effects, Json, say_json, wrote
from twingap.cli.progress import progress


def train(
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR", help="Folder for the results, DIR/learnt and DIR/classifier, and for what leads to them."
        ),
    ],
    machines: Annotated[
        int | None,
        typer.Option(metavar="N", help="Simulated machines to learn from; default: as many as what ships.", min=20),
    ] = None,
    backend: Annotated[str, typer.Option(help="Where simulations run: loky (this machine) or dask.")] = "loky",
    address: Annotated[str | None, typer.Option(help="Of a running dask scheduler.", show_default=False)] = None,
    jobs: Annotated[
        int | None, typer.Option(metavar="J", help="Simulations at once; default: one a core.", min=1)
    ] = None,
    effects: Effects = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of everything random; default: that of what ships.", min=0)
    ] = None,
    as_json: Json = False,
) -> None:
    """Learn from simulations what the diagnosis and `classify` ship with (maintainers). Goes on where it was stopped.

    The files below DIR/learnt go to twingap/gap/knowledge/learnt, those below DIR/classifier to twingap/adapt/learnt.
    """
    from twingap.files import try_folder

    try_folder(out)
    with progress("loading") as shown:
        from twingap.gap.knowledge import training

        folder = training.train(
            out,
            seed=training.SEED if seed is None else seed,
            machines=machines or training.MACHINES,
            backend=backend,
            address=address,
            jobs=jobs,
            progress=shown.share,
        )
        from twingap.adapt.learning import train_classifier

        own = out / "classifier"
        own.mkdir(exist_ok=True)
        train_classifier(own, seed=seed or 0, jobs=jobs or 2, progress=shown.share)
    paths = sorted(path for place in (folder, own) for path in place.iterdir() if path.is_file())
    if as_json:
        from twingap.provenance import digest_of_path

        say_json([{"path": str(path), "sha256": digest_of_path(path)} for path in paths])
    wrote(*paths, as_json=as_json)
