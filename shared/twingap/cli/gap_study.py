"""`twingap gap study`: the blind study of the diagnosis."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Json, Seed, progress_console, say, say_json, show, wrote


def study(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder; an interrupted study is taken up again.")],
    cases: Annotated[int, typer.Option("--cases", metavar="N", help="Worlds, at least 6.", min=6)] = 300,
    seed: Seed = 0,
    jobs: Annotated[
        int | None, typer.Option("--jobs", metavar="J", help="Processes; one per core when absent.", min=1)
    ] = None,
    rivals: Annotated[
        int | None,
        typer.Option(
            "--rival-worlds", metavar="W", min=0, help="Worlds that the rivals learn from; 0: none that learn.",
            show_default="1500, or 5 per world where that is less",
        ),
    ] = None,
    json: Json = False,
) -> None:  # fmt: skip
    """Diagnose machines of known truth blind, and score: made, sealed, diagnosed, unsealed, scored beside rivals."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from twingap.rigs.worlds import cases as plan
    from twingap.study import run_study, write_study
    from twingap.study.runner import command_line

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    quiet = not progress_console.is_terminal
    try:
        with Progress(*columns, console=progress_console, transient=True, disable=quiet) as bar:
            line = bar.add_task("cases", total=None)
            done = run_study(
                out,
                plan(cases, seed),
                seed,
                training_count=min(1500, 5 * cases) if rivals is None else rivals,
                jobs=jobs,
                command=command_line(),
                report=lambda what, part, whole: bar.update(line, description=what, completed=part, total=whole),
            )
    except KeyboardInterrupt:  # typer would end without a word
        print("twingap: interrupted; what was finished is kept, run the same command to go on", file=sys.stderr)
        raise typer.Exit(130) from None
    paths = write_study(done, out)
    if json:
        say_json(done.table["scores"])
    else:
        title = f"blind study, {cases} worlds, seed {seed}"
        show([{**row, "met": {None: "", True: "met", False: "missed"}[row["met"]]} for row in done.table["scores"]],
             False, title)  # fmt: skip
        for name, why in done.table["provenance"]["rivals_skipped"].items():
            say(f"rival not run: {name}: {why}")
    wrote(*paths, as_json=json)
