"""`twingap study`: the blind study of the diagnosis, and the study on public records."""

from __future__ import annotations

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
    examples,
    say,
    say_json,
    show,
    wrote,
)
from twingap.cli.progress import resumable
from twingap.cli.tracking import Track, Tracking
from twingap.errors import TwingapError

app = typer.Typer(
    help="Studies of the diagnosis: on simulated machines of known truth, on public records.", no_args_is_help=True
)

Jobs = Annotated[int | None, typer.Option("--jobs", metavar="J", help="Processes; one per core when absent.", min=1)]


@app.command("blind", epilog=examples("twingap study blind --out study --cases 60 --seed 1"))
def blind(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder; an interrupted study is resumed.")],
    cases: Annotated[int, typer.Option("--cases", metavar="N", help="Simulated machines, at least 6.", min=6)] = 300,
    rich: Annotated[
        int | None,
        typer.Option(
            "--rich", metavar="N", min=0, help="Additional machines, with many modes and lines.",
            show_default="half as many",
        ),
    ] = None,
    effects: Effects = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    backend: Where = Backend.loky,
    address: Address = None,
    rivals: Annotated[
        int | None,
        typer.Option(
            "--rival-worlds", metavar="W", min=0, help="Worlds on which rival methods are trained; 0: no rivals.",
            show_default="1500, or 5 per world where that is less",
        ),
    ] = None,
    closest: Annotated[
        bool, typer.Option("--closest", help="Look for the closest twin too, as `twingap gap` does without --quick.")
    ] = False,
    track: Track = True,
    tracking_uri: TrackingUri = None,
    json: Json = False,
) -> None:  # fmt: skip
    """Diagnose simulated machines of known truth blind, and score the diagnosis next to rival methods."""
    from twingap.rigs.worlds import cases as plan
    from twingap.study import run_study, write_study
    from twingap.study.rivals import PERMUTATIONS
    from twingap.study.runner import command_line
    from twingap.study.tracking import track_blind

    tracking = Tracking("study blind", track, tracking_uri)
    with resumable("cases") as shown:
        done = run_study(
            out,
            plan(cases, seed, cases // 2 if rich is None else rich),
            seed,
            training_count=min(1500, 5 * cases) if rivals is None else rivals,
            permutations=0 if rivals == 0 else PERMUTATIONS,
            closest=closest,
            jobs=jobs,
            backend=backend.value,
            address=address,
            command=command_line(),
            progress=shown.count,
        )
    paths = write_study(done, out)
    tracking.log(lambda tracker: track_blind(tracker, done.table, paths))
    if json:
        say_json(done.table["scores"])
    else:
        title = f"blind study, {done.table['provenance']['cases']} worlds, seed {seed}"
        show([{**row, "met": {None: "", True: "met", False: "missed"}[row["met"]]} for row in done.table["scores"]],
             False, title)  # fmt: skip
        for name, why in done.table["provenance"]["rivals_skipped"].items():
            say(f"rival not run: {name}: {why}")
    wrote(*paths, as_json=json)


@app.command("public", epilog=examples("twingap study public --out public --sets cwru"))
def public(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder; an interrupted run is resumed.")],
    sets: Annotated[
        str,
        typer.Option(
            "--sets", metavar="NAMES", help="Public sets, separated by commas; effects are added to the first."
        ),
    ] = "cwru,hit_sm",
    root: Annotated[
        Path | None,
        typer.Option("--root", help="Folder that holds the data sets, one folder each; TWINGAP_DATA when absent."),
    ] = None,
    pieces: Annotated[
        int, typer.Option("--pieces", metavar="N", help="Records of 1 s from each recording.", min=2, max=60)
    ] = 2,
    splits: Annotated[
        int, typer.Option("--splits", metavar="N", help="Random splits into halves with nothing added, per set.", min=0)
    ] = 6,
    injections: Annotated[
        int, typer.Option("--injections", metavar="N", help="Splits into halves on which each effect is added.", min=0)
    ] = 1,
    single_pieces: Annotated[
        int,
        typer.Option("--single", metavar="N", help="Records of each recording diagnosed by itself; 0: none.", min=0),
    ] = 3,
    parts: Annotated[
        str,
        typer.Option(
            "--parts",
            metavar="NAMES",
            help="Parts, separated by commas: verdicts; closest (twins, stated splits); filtered (a path added).",
        ),
    ] = "verdicts,closest,filtered",
    effects: Effects = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    backend: Where = Backend.loky,
    address: Address = None,
    track: Track = True,
    tracking_uri: TrackingUri = None,
    json: Json = False,
) -> None:
    """Diagnose public records: what each paper's twin lacks, effects withheld or added, single recordings; and test
    the closest twin on recordings and bearings that it has not seen, and a path on records through a random filter."""
    from twingap.study.public import Plan, run_public
    from twingap.study.public_closest_report import closure_rows
    from twingap.study.public_filter import filter_rows
    from twingap.study.public_report import twin_rows, write_public
    from twingap.study.runner import command_line
    from twingap.study.tracking import track_public

    tracking = Tracking("study public", track, tracking_uri)
    names, wanted = (tuple(dict.fromkeys(n.strip() for n in text.split(",") if n.strip())) for text in (sets, parts))
    if not wanted:
        raise TwingapError("names no part", where="--parts", mend="leave it out, or name verdicts, closest or filtered")
    plan = Plan(names, seed, pieces, splits, injections, single_pieces, wanted)
    with resumable("sets") as shown:
        table = run_public(
            out,
            plan,
            root=None if root is None else str(root),
            jobs=jobs,
            backend=backend.value,
            address=address,
            command=command_line(),
            progress=shown.count,
        )
    paths = write_public(table, out)
    tracking.log(lambda tracker: track_public(tracker, table, paths))
    if json:
        say_json([*table["twins"], *table["closest"], *table["filtered"]])
    else:
        if table["twins"]:
            show(twin_rows(table), False, "what each twin lacks")
        if table["closest"]:
            show(closure_rows(table["closest"]), False, "what the closest twin closes")
        if table["filtered"]:
            show(filter_rows(table["filtered"]), False, "records through a filter")
        say(*(f"note: {name} is left out: {why}" for name, why in table["skipped"].items()))
    wrote(*paths, as_json=json)
