"""`twingap run`: tables and figures of a paper."""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import (
    Address,
    Backend,
    Effects,
    Json,
    Seed,
    TrackingUri,
    Where,
    say,
    say_json,
    show,
    wrote,
)
from twingap.cli.progress import progress


class Paper(enum.StrEnum):
    """Papers by number."""

    paper1 = "paper1"
    paper2 = "paper2"
    paper3 = "paper3"


class ProfileName(enum.StrEnum):
    """Extent of the run."""

    smoke = "smoke"
    full = "full"


def run(
    paper: Annotated[Paper, typer.Argument(help="Paper to reproduce.")],
    profile: Annotated[
        ProfileName, typer.Option(help="smoke: minutes; full: all tasks and seeds.")
    ] = ProfileName.smoke,
    backend: Where = Backend.loky,
    address: Address = None,
    out: Annotated[Path | None, typer.Option(help="Folder of tables, figures and results [.twingap/PAPER].")] = None,
    root: Annotated[Path | None, typer.Option(help="Data root; TWINGAP_DATA when absent.")] = None,
    effects: Effects = None,
    seed: Seed = 0,
    tracking_uri: TrackingUri = None,
    json: Json = False,
    check_configs: Annotated[
        bool, typer.Option("--check-configs", help="Read the configuration of every study, and run nothing.")
    ] = False,
) -> None:
    """Reproduce the tables and figures of a paper; tracked, and resumable after an interruption."""
    from papers import reproduce
    from papers.framework import rows_of
    from twingap.track import MlflowTracker, state_folder

    if check_configs:
        for line in reproduce.check_configurations():
            say(line)
        return
    tracker = MlflowTracker(tracking_uri, paper.value)
    try:
        with progress("reading") as shown:
            outcome = reproduce.run(
                paper.value,
                profile.value,
                out=out or state_folder() / paper.value,
                root=root,
                seed=seed,
                backend=backend.value,
                address=address,
                tracker=tracker,
                progress=shown.count,
            )
    except KeyboardInterrupt:  # typer would end without a message
        print("twingap: interrupted; finished results are kept, run the same command to continue", file=sys.stderr)
        raise typer.Exit(130) from None
    if json:
        say_json(outcome.rows)
    else:
        for work in outcome.works.values():
            for title, table in work.shown():
                show(rows_of(table), False, title)
        say(*outcome.notes(), f"MLflow run {outcome.run_id} in {tracker.uri}; show it with: twingap ui")
    wrote(outcome.out / "tables", outcome.out / "figures", as_json=json)
