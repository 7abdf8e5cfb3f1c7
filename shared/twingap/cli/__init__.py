"""The command line: one module per command, each thin over the library.

A user's mistake ends in one line on standard error and exit status 2; an interruption in exit status 130.
"""

from __future__ import annotations

import sys

import typer

from twingap.cli import bench, data, identify, run, simulate, ui
from twingap.errors import TwingapError

app = typer.Typer(
    name="twingap",
    help="Simulated bearing vibration, and what it lacks: twins, their gap to real records, three papers reproduced.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(data.app, name="data")
app.command("simulate")(simulate.simulate)
app.command("identify")(identify.identify)
app.command("run")(run.run)
app.command("bench")(bench.bench)
app.command("ui")(ui.ui)


def main() -> None:
    """Entry point of the `twingap` command."""
    try:
        app()
    except TwingapError as error:
        print(f"twingap: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("twingap: interrupted; what was finished is kept, run the same command to go on", file=sys.stderr)
        sys.exit(130)
