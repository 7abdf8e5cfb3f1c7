"""Command line: one module per command, each a thin layer over the library.

User errors give one line on standard error and exit status 2, an interruption exit status 130, SIGTERM exit status 143.
None of them leaves incomplete files.
"""

from __future__ import annotations

import io
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, NoReturn

import typer
from typer.core import TyperGroup

from twingap import __version__
from twingap.cli import (
    bearings,
    bench,
    classify,
    close,
    data,
    demo,
    effects,
    fleet,
    gap,
    health,
    identify,
    import_,
    rul,
    run,
    simulate,
    study,
    train,
    ui,
)  # fmt: skip
from twingap.cli.options import examples
from twingap.errors import TwingapError

_UsageError: Any = typer.BadParameter.__bases__[0]
"""Error of unknown commands and options and of values out of range: that of Click, or its copy in later typer."""


class _InterruptedError(Exception):
    """Ctrl-C as an error that typer does not handle; it would end without a message on KeyboardInterrupt."""


@contextmanager
def _uninterrupted_by_typer() -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt as interruption:
        raise _InterruptedError from interruption


class _Commands(TyperGroup):
    """Group of commands whose interruption reaches `main`."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        with _uninterrupted_by_typer():
            return super().make_context(*arguments, **options)

    def invoke(self, ctx: Any) -> Any:
        with _uninterrupted_by_typer():
            return super().invoke(ctx)


app = typer.Typer(
    name="twingap",
    cls=_Commands,
    help="Simulated bearing vibration, and what it lacks: twins, their gap to real records, three papers reproduced.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"twingap {__version__}")
        raise typer.Exit


@app.callback()
def _top(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None: ...


def _add(name: str, function: Callable[..., None], *lines: str, hidden: bool = False) -> None:
    """Add a command with examples."""
    app.command(name, epilog=examples(*(f"twingap {name} {line}".rstrip() for line in lines)), hidden=hidden)(function)


_add("demo", demo.demo, "", "--seed 3 --out another-machine")
app.add_typer(data.app, name="data")
_add(
    "import", import_.import_, "*.csv --speed-rpm 1800 --bearing 6205 --out SET",
    "exports --names '{fault}_{speed_rpm:d}rpm.csv' --unit g --out SET", "run.tdms --tacho-channel run/tacho --dry-run",
)  # fmt: skip
_add("simulate", simulate.simulate, "twin.toml --records RECORDSET --out simulated")
_add("identify", identify.identify, "twin.toml RECORDSET --out identified.toml")
_add(
    "gap", gap.gap, "RECORDSET --twin twin.toml --out gap", "RECORDSET --twin twin.toml --sim MINE --out gap",
    "RECORDSET --twin twin.toml --out gap --export",
    "RECORDSET --twin twin.toml --out gap --quick",
)  # fmt: skip
_add("close", close.close, "RECORDSET --twin twin.toml --out closed.toml")
_add(
    "fleet", fleet.fleet, "MACHINES --twin twin.toml --out fleet", "MACHINES --twin twin.toml --out fleet --quick",
    "MACHINES --twin twin.toml --out fleet --backend dask --address tcp://HOST:8786",
)  # fmt: skip
app.add_typer(study.app, name="study")
_add("train", train.train, "--out training", "--out training --backend dask --address tcp://head:8786")
_add("effects", effects.effects, "", "slip_jitter", "--effects mine.py --json")
_add("bearings", bearings.bearings, "", "6205")
_add("classify", classify.classify, "RECORDSET --twin twin.toml --out predictions.csv")
_add("rul", rul.rul, "RECORDSET --limit 20 --out rul.csv")
_add("health", health.health, "RECORDSET --out health", "features.csv --indicator rms --limit 4 --out health")
_add("degrade", health.health, "RECORDSET --out health", hidden=True)
_add("run", run.run, "paper2", "paper3 --profile full --backend dask --address tcp://HOST:8786")
_add("bench", bench.bench, "--quick", "vmd --strict")
_add("ui", ui.ui, "--port 5001")

_MOVED: Final = {"train": "train", "study": "study blind", "public": "study public"}
"""Former subcommands of `twingap gap` -> their present names."""


def main() -> None:
    """Entry point of the `twingap` command."""
    signal.signal(signal.SIGTERM, _end)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whatever started this
            setattr(sys, name, io.StringIO())
    # joblib replaces workers that use much memory; users need not act on it.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
    if len(sys.argv) > 2 and sys.argv[1] == "gap" and sys.argv[2] in _MOVED and not Path(sys.argv[2]).is_dir():
        _refuse(TwingapError(f"`twingap gap {sys.argv[2]}` is now `twingap {_MOVED[sys.argv[2]]}`"))
    try:
        status = app(prog_name="twingap", standalone_mode=False)
    except TwingapError as error:
        _refuse(error)
    except _UsageError as error:
        if not error.format_message():  # no command given: typer has shown the help
            sys.exit(2)
        _refuse(_misused(error))
    except (_InterruptedError, KeyboardInterrupt, typer.Abort):
        print("twingap: interrupted; no incomplete files are left", file=sys.stderr)
        sys.exit(130)
    except MemoryError:
        _refuse(TwingapError("memory ran out", mend="use shorter records, lower rates or lower speeds"))
    except OSError as error:
        # Errors that commands do not handle, for instance a full disk of the tracking store.
        _refuse(TwingapError(f"cannot be used: {error.strerror or error}", where=error.filename))
    sys.exit(status if isinstance(status, int) else 0)


def _end(number: int, frame: object) -> NoReturn:
    """Unwind, so that temporary files and folders are removed."""
    sys.exit(128 + number)


def _refuse(error: TwingapError) -> NoReturn:
    print(f"twingap: {error}", file=sys.stderr)
    sys.exit(2)


def _misused(error: Any) -> TwingapError:
    """Usage error in one line."""
    path = "twingap" if error.ctx is None else error.ctx.command_path
    message = error.format_message().strip().rstrip(".")
    return TwingapError(message[:1].lower() + message[1:], mend=f"see `{path} --help`")
