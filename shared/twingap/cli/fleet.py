"""`twingap fleet`: diagnosis of every record set below a folder, and what the machines have in common."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from twingap.cli.progress import resumable
from twingap.cli.tracking import Track, Tracking

if TYPE_CHECKING:
    from twingap.fleet import Fleet


def fleet(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder that holds the record sets, at any depth.")],
    twin: Annotated[Path, typer.Option(metavar="TWIN.toml", help="Twin of the machines.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the reports; an interrupted run is resumed.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Leave out the closest twin and what each group of effects closes.")
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(metavar="J", help="Machines at once; one per core when absent.", min=1)
    ] = None,
    backend: Where = Backend.loky,
    address: Address = None,
    track: Track = True,
    tracking_uri: TrackingUri = None,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Diagnose every record set below a folder, and report the fleet on one page.

    Each machine has its own report in DIR, at the path of its record set. Machines that DIR holds already, with the
    same records, twin and settings, are not diagnosed again. A record set that cannot be diagnosed has a row with
    the reason. Workers of a cluster must see FOLDER at the same path.
    """
    from twingap.files import try_outputs
    from twingap.twins.twin_file import read_twin

    read_twin(twin)  # reports an invalid file before slow imports
    tracking = Tracking("fleet", track, tracking_uri)
    try_outputs(out, ("fleet.json", "fleet.csv", "fleet.html"))
    with resumable("loading") as shown:
        from twingap.fleet import run_fleet, write_fleet
        from twingap.fleet.tracking import track_fleet
        from twingap.fleet.written import to_json

        found = run_fleet(
            folder,
            twin,
            out,
            seed=seed,
            quick=quick,
            backend=backend.value,
            address=address,
            jobs=jobs,
            progress=shown.count,
        )
        paths = write_fleet(found, out)
        shown.count("tracking", 0, None)
        tracking.log(lambda tracker: track_fleet(tracker, found, out, paths))
    if as_json:
        say_json(to_json(found))
    else:
        _print(found)
    wrote(*paths, as_json=as_json)


def _print(found: Fleet) -> None:
    """Print machines, effects that they share, and what could not be diagnosed."""
    from twingap.fleet.page import TITLES

    rows: list[dict[str, Any]] = [
        {
            "machine": machine.path,
            "verdict": TITLES[machine.status].lower(),
            "named as missing": ", ".join(machine.effects),
            "gap, x floor": machine.gap,
            "closes": "" if machine.closure is None else f"{round(100 * machine.closure)}%",
            "difference": None if machine.difference is None else f"{machine.difference:.1f}",
        }
        for machine in found.machines
    ]
    show(rows[:_MOST], False, title="Machines, those that differ most from the rest first")
    if len(rows) > _MOST:
        say(f"{len(rows) - _MOST} more machines on the page")
    named = [
        {
            "effect": row.effect,
            "named for": f"{row.named} of {row.of}",
            "90% interval": "{:.0%} to {:.0%}".format(*row.rate_ci),
        }
        for row in found.effects
        if row.named
    ]
    if named:
        show(named, False, title="Effects that they share")
    say(*(f"not diagnosed: {m.path}: {m.reason}" for m in found.machines if not m.diagnosed))


_MOST = 40
"""Machines that are printed."""
