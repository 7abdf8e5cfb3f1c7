"""`twingap gap`: what a twin lacks, and its blind study.

twingap gap RECORDSET --twin TWIN.toml --out DIR     the diagnosis
twingap gap study ...                                the blind study
twingap gap public ...                               the diagnosis on public records
twingap gap train ...                                what the diagnosis learns beforehand
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from typer.core import TyperCommand, TyperGroup

from twingap.cli.gap_public import public
from twingap.cli.gap_study import study
from twingap.cli.options import Json, Seed, TrackingUri, progress_console, say, say_json, show, wrote
from twingap.errors import TwingapError

if TYPE_CHECKING:
    from twingap.gap.report.model import GapReport
    from twingap.track import Tracker

_MAIN: Final = "RECORDSET"
"""What the help lists the diagnosis as. It is never typed: whatever names no other command is a record set."""
_HELP: Final = ("-h", "--help")


class _Unnamed(typer.Context):
    """The context of a command whose name is not typed: usage and errors speak of the group."""

    @property
    def command_path(self) -> str:
        return super().command_path.removesuffix(f" {_MAIN}")


class _Main(TyperCommand):
    context_class = _Unnamed


class _WithMain(TyperGroup):
    """A group that is a command itself: arguments that begin with no command's name go to the one named `_MAIN`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        others = self.commands.keys() - {_MAIN}
        if args and args[0] not in others and args[0] not in _HELP:
            args = [_MAIN, *args]
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Help of the diagnosis, then the other commands."""
        main = self.commands[_MAIN]
        main.format_help(main.context_class(main, info_name=_MAIN, parent=ctx), formatter)
        super().format_help(ctx, formatter)


app = typer.Typer(
    cls=_WithMain,
    help="What a twin lacks. Beside the diagnosis itself (RECORDSET, above) there are three commands; a record set in "
    "a folder named like one of them is given as ./study, ./train or ./public.",
    no_args_is_help=True,
)


@app.command(_MAIN, cls=_Main)
def diagnose(
    recordset: Annotated[Path, typer.Argument(metavar="RECORDSET", help="Records of the machine.")],
    twin: Annotated[Path, typer.Option(metavar="TWIN.toml", help="What is already modelled.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for gap.json and report.html.")],
    sim: Annotated[
        Path | None,
        typer.Option(metavar="RECORDSET", help="Your own simulated records instead of those of the built-in twin."),
    ] = None,
    export: Annotated[
        bool, typer.Option("--export", help="Write record sets DIR/sim_before and DIR/sim_after too.")
    ] = False,
    closest: Annotated[
        bool,
        typer.Option(
            "--closest",
            help="Where a rest remains, also look for effects that stand in for it (minutes), and write the closest "
            "twin: DIR/closest.toml; with --export its records too, DIR/sim_closest.",
        ),
    ] = False,
    track: Annotated[
        bool, typer.Option("--track/--no-track", help="Keep the diagnosis as a run for `twingap ui`.")
    ] = True,
    tracking_uri: TrackingUri = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Where records and twin differ, which effect the twin lacks, and how far the gap shrinks when it is added."""
    from twingap.files import try_outputs
    from twingap.gap.report.files import to_json
    from twingap.records.folder import read_record_set
    from twingap.twins.twin_file import read_twin

    read_twin(twin)  # what was mistyped is told before anything slow is imported
    records = read_record_set(recordset)
    simulated = None if sim is None else read_record_set(sim)
    # An address that was typed must work; the default one is tried when there is something to keep.
    tracker = _tracker(tracking_uri) if track and tracking_uri is not None else None
    twins = ("closest.toml",) if closest and simulated is None else ()
    exports = ("sim_before", "sim_after", "sim_closest")[: 3 if closest else 2] if export else ()
    try_outputs(out, ("gap.json", "report.html", *twins), exports)
    with _bar() as progress:
        from twingap.gap import diagnose as run

        found = run(records, twin, seed=seed, sim=simulated, closest=closest, progress=progress)
        paths = found.write(out, export=export, progress=progress)
    about = found.report
    if track:
        _keep(about, paths[:2], tracker)
    if as_json:
        say_json(to_json(about))
    else:
        _tell(about)
    wrote(*paths, as_json=as_json)


@app.command("train")
def train(
    cache: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where to keep it; default, and where the diagnosis looks: twingap's cache."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of everything random; default: the diagnosis's own.", min=0)
    ] = None,
    as_json: Json = False,
) -> None:
    """Train beforehand what the diagnosis learns from simulated gaps; a diagnosis that finds nothing does it itself."""
    from twingap.gap.knowledge.training import SEED
    from twingap.gap.knowledge.training import train as run

    seed = SEED if seed is None else seed
    with _bar() as report_step:
        path = run(cache, seed, report_step)
    if as_json:
        from twingap.provenance import digest_of_path

        say_json({"path": str(path), "sha256": digest_of_path(path), "seed": seed})
    wrote(path, as_json=as_json)


app.command("study")(study)
app.command("public")(public)


@contextmanager
def _bar() -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error that is told what is done and which part of the whole, 0 to 1."""
    from rich.progress import Progress

    with Progress(console=progress_console, transient=True, disable=not progress_console.is_terminal) as progress:
        task = progress.add_task("reading", total=1.0)
        yield lambda what, fraction: progress.update(task, description=what, completed=fraction)


def _tracker(uri: str | None) -> Tracker:
    from twingap.track import MlflowTracker

    return MlflowTracker(uri)


def _keep(report: GapReport, paths: Sequence[Path], tracker: Tracker | None) -> None:
    """Track the diagnosis. It is done and written: a store that cannot be used is worth a line, no more."""
    from twingap.gap.report.tracking import track_report

    try:
        track_report(tracker or _tracker(None), report, paths)
    except TwingapError as error:
        print(f"twingap: not tracked: {error}", file=sys.stderr)


def _ends(ci: tuple[float, float]) -> str:
    """An interval of a closure; where it ends at what closures are bounded to, so said."""
    from twingap.gap.distance.closure import CLOSURE_BOUNDS

    low, high = (f"{round(100 * end)}%" for end in ci)
    low += " or less" * (ci[0] <= CLOSURE_BOUNDS[0])
    high += " or more" * (ci[1] >= CLOSURE_BOUNDS[1])
    return f"{low} to {high}"


def _tell(report: GapReport) -> None:
    """The verdict, the likeliest candidates and the measures, for people."""
    from twingap.gap.report.advice import next_steps, place_words

    say(report.sentence)
    if report.stand_ins is not None:
        say(report.stand_ins.sentence)
    if report.places:
        rows = [
            {"where": p.domain, "place": place_words(p), "share": f"{p.share:.0%}", "p": f"{p.p_value:.2g}"}
            for p in report.places[:8]
        ]
        show(rows, False, title="Where the gap lies")
    shown = [c for i, c in enumerate(report.candidates) if i < 6 or c.effect in report.verdict.effects]
    if shown and report.verdict.status != "no_gap":
        rows = [
            {
                "effect": c.effect,
                "probability": f"{c.probability:.0%}",
                "closes": "cannot be added" if c.acts is not None else f"{round(100 * c.closure)}%",
                "90% interval": "" if c.acts is not None else _ends(c.closure_ci),
                "named": "yes" if c.effect in report.verdict.effects else "",
            }
            for c in shown
        ]
        show(rows, False, title="Which effect is missing")
    if report.metrics:
        closest = {} if report.stand_ins is None else {m.metric: m.after for m in report.stand_ins.metrics}
        measures = [
            {"measure": m.metric, "before": m.before, "after": m.after}
            | ({"closest": closest.get(m.metric)} if closest else {})
            | {"floor": m.floor}
            for m in report.metrics
        ]
        show(measures, False, title="How far the gap shrinks")
    for note in report.notes:
        say(f"note: {note}")
    for step in next_steps(report)[:1]:
        say(f"next: {step}")
