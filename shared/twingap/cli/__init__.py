"""The command line: one module per command, each thin over the library.

A user's mistake ends in one line on standard error and exit status 2; an interruption in exit status 130, an order to
end (SIGTERM) in 143. Neither leaves anything half-written.
"""

from __future__ import annotations

import signal
import sys
import warnings
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from twingap.cli import bench, classify, data, degrade, gap, identify, rul, run, simulate, ui
from twingap.errors import TwingapError

_UsageError: Any = typer.BadParameter.__bases__[0]
"""What unknown commands and options and values out of range raise. Click's own, or in later typer a copy of it."""


class _InterruptedError(Exception):
    """Ctrl-C, under a name that typer does not swallow: it ends without a word on KeyboardInterrupt."""


class _Commands(TyperGroup):
    """The commands; an interruption of any of them reaches `main`."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interruption:
            raise _InterruptedError from interruption


app = typer.Typer(
    name="twingap",
    cls=_Commands,
    help="Simulated bearing vibration, and what it lacks: twins, their gap to real records, three papers reproduced.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(data.app, name="data")
app.command("simulate")(simulate.simulate)
app.command("identify")(identify.identify)
app.add_typer(gap.app, name="gap")
app.command("classify")(classify.classify)
app.command("rul")(rul.rul)
app.command("degrade")(degrade.degrade)
app.command("run")(run.run)
app.command("bench")(bench.bench)
app.command("ui")(ui.ui)


def main() -> None:
    """Entry point of the `twingap` command."""
    signal.signal(signal.SIGTERM, _end)
    # A worker that has grown is replaced, and its jobs go to the next: nothing that a user could do anything about.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
    try:
        status = app(prog_name="twingap", standalone_mode=False)
    except TwingapError as error:
        _refuse(error)
    except _UsageError as error:
        if not error.format_message():  # no command given: typer has shown the help
            sys.exit(2)
        _refuse(_misused(error))
    except (_InterruptedError, KeyboardInterrupt, typer.Abort):
        print("twingap: interrupted; nothing half-written is left", file=sys.stderr)
        sys.exit(130)
    except MemoryError:
        _refuse(TwingapError("memory ran out", mend="ask for shorter records, lower rates or lower speeds"))
    except OSError as error:
        # What a command foresees it explains itself; this is a full disk under the tracking store, say.
        _refuse(TwingapError(f"cannot be used: {error.strerror or error}", where=error.filename))
    sys.exit(status if isinstance(status, int) else 0)


def _end(number: int, frame: object) -> NoReturn:
    """Unwind, so that temporary files and folders are removed."""
    sys.exit(128 + number)


def _refuse(error: TwingapError) -> NoReturn:
    print(f"twingap: {error}", file=sys.stderr)
    sys.exit(2)


def _misused(error: Any) -> TwingapError:
    """A mistake in what was typed, in one line."""
    path = "twingap" if error.ctx is None else error.ctx.command_path
    message = error.format_message().strip().rstrip(".")
    return TwingapError(message[:1].lower() + message[1:], mend=f"see `{path} --help`")
