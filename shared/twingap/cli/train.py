"""`twingap train`: training of the shipped models (for maintainers)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Address, Backend, Effects, Json, Where, say_json, wrote
from twingap.cli.progress import progress


def train(
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR", help="Folder for the results, DIR/learnt and DIR/classifier, and for intermediate files."
        ),
    ],
    machines: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Simulated machines of the training; as many as for the shipped models when absent.",
            min=20,
        ),
    ] = None,
    backend: Where = Backend.loky,
    address: Address = None,
    jobs: Annotated[
        int | None, typer.Option(metavar="J", help="Parallel simulations; one per core when absent.", min=1)
    ] = None,
    effects: Effects = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of all random numbers; that of the shipped models when absent.", min=0)
    ] = None,
    as_json: Json = False,
) -> None:
    """Train the models of the diagnosis and of `classify` on simulations (for maintainers); resumable.

    Files of DIR/learnt belong in twingap/gap/knowledge/learnt, those of DIR/classifier in twingap/adapt/learnt.
    """
    from twingap.files import try_folder

    try_folder(out)
    with progress("loading") as shown:
        from twingap.gap.knowledge import training

        folder = training.train(
            out,
            seed=training.SEED if seed is None else seed,
            machines=machines or training.MACHINES,
            backend=backend.value,
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
