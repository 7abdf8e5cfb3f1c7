"""`twingap gap public`: the diagnosis on public records."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Json, Seed, progress_console, say, say_json, show, wrote


def public(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder; an interrupted run is taken up again.")],
    sets: Annotated[
        str, typer.Option("--sets", metavar="NAMES", help="Public sets, by comma; effects are added to the first.")
    ] = "cwru,hit_sm",
    root: Annotated[
        Path | None,
        typer.Option("--root", help="Folder that holds the data sets, one folder each; default TWINGAP_DATA."),
    ] = None,
    pieces: Annotated[
        int, typer.Option("--pieces", metavar="N", help="Records of 1 s from each recording.", min=2, max=60)
    ] = 2,
    splits: Annotated[
        int, typer.Option("--splits", metavar="N", help="Random halvings with nothing added, per set.", min=0)
    ] = 6,
    injections: Annotated[
        int, typer.Option("--injections", metavar="N", help="Halvings that each effect is added on.", min=0)
    ] = 1,
    single_pieces: Annotated[
        int,
        typer.Option("--single", metavar="N", help="Records of each recording diagnosed by itself; 0: none.", min=0),
    ] = 3,
    seed: Seed = 0,
    jobs: Annotated[
        int | None, typer.Option("--jobs", metavar="J", help="Processes; one per core when absent.", min=1)
    ] = None,
    json: Json = False,
) -> None:
    """Diagnose public records: what each paper's twin lacks, effects withheld or added, single recordings."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from twingap.study.public import Plan, run_public
    from twingap.study.public_report import twin_rows, write_public
    from twingap.study.runner import command_line

    names = tuple(dict.fromkeys(name.strip() for name in sets.split(",") if name.strip()))
    plan = Plan(names, seed, pieces, splits, injections, single_pieces)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    quiet = not progress_console.is_terminal
    try:
        with Progress(*columns, console=progress_console, transient=True, disable=quiet) as bar:
            line = bar.add_task("sets", total=None)
            table = run_public(
                out,
                plan,
                root=None if root is None else str(root),
                jobs=jobs,
                command=command_line(),
                report=lambda what, part, whole: bar.update(line, description=what, completed=part, total=whole),
            )
    except KeyboardInterrupt:  # typer would end without a word
        print("twingap: interrupted; what was finished is kept, run the same command to go on", file=sys.stderr)
        raise typer.Exit(130) from None
    paths = write_public(table, out)
    if json:
        say_json(table["twins"])
    else:
        show(twin_rows(table), False, "what each twin lacks")
        say(*(f"note: {name} is left out: {why}" for name, why in table["skipped"].items()))
    wrote(*paths, as_json=json)
