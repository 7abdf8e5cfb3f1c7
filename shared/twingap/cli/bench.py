"""`twingap bench`: benchmarks and their targets."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twingap.cli.options import Effects, Json, Seed, TrackingUri, say, say_json, show, standard, wrote
from twingap.cli.progress import progress

if TYPE_CHECKING:
    from benchmarks.harness import Measurement


def bench(
    name: Annotated[str | None, typer.Argument(help="Benchmark to run; all when absent.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Small sizes, to test that benchmarks run.")] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit 1 when a target is missed.")] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of a page, a chart and bench.json; keeps other results."),
    ] = None,
    track: Annotated[bool, typer.Option(help="Log the table and the targets as a run.")] = True,
    tracking_uri: TrackingUri = None,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Run benchmarks; each compares twingap with another library in the same run, as ratios."""
    import benchmarks
    from twingap.errors import TwingapError
    from twingap.files import try_outputs
    from twingap.track import MlflowTracker, NullTracker, Tracker
    from twingap.track import tracking_uri as store

    if name is not None and name not in benchmarks.names():
        raise TwingapError(f"unknown benchmark {name!r}", mend=f"known: {', '.join(benchmarks.names()) or 'none'}")
    chosen = benchmarks.names() if name is None else (name,)
    if out is not None:
        try_outputs(out, ("bench.json", "benchmarks.md", "benchmarks.svg"))
    # An unusable store is reported before the benchmarks.
    tracker: Tracker = MlflowTracker(tracking_uri, experiment="bench") if track else NullTracker()
    done: dict[str, Measurement] = {}
    paths: list[Path] = []
    left_out: list[str] = []
    with progress("benchmarks", len(chosen)) as shown:
        for each in chosen:
            try:
                done[each] = benchmarks.measure(each, quick=quick, seed=seed)
            except TwingapError as error:
                if name is not None:
                    raise
                left_out.append(str(error))  # others run without a GPU or that peer
            else:
                _log(tracker, each, done[each], {"benchmark": each, "quick": quick, "seed": seed})
                if out is not None:
                    from benchmarks import _written

                    paths = _written.write([standard(_report(each, done[each], quick))], out)
            shown.step(each)
    reports = standard([_report(each, measurement, quick) for each, measurement in done.items()])
    wrote(*paths, as_json=as_json)
    for why in left_out:
        print(f"left out: {why}", file=sys.stderr)
    if as_json:
        say_json(reports)
    else:
        for each, measurement in done.items():
            _print(each, measurement, quick)
    if track:
        print(f"runs logged in {store(tracking_uri)}", file=sys.stderr if as_json else sys.stdout)
    if strict and not all(target.met for measurement in done.values() for target in measurement.targets):
        raise typer.Exit(1)


def _log(tracker: Any, name: str, measurement: Measurement, parameters: dict[str, Any]) -> None:
    import pandas as pd

    with tracker.run(f"bench {name}", tags={"benchmark": name}) as run:
        run.parameters(parameters)
        run.table("measured", pd.DataFrame(list(measurement.rows)))
        targets = [_target(t) for t in measurement.targets]
        if targets:
            run.table("targets", pd.DataFrame(targets))
            run.metrics({t.name: t.value for t in measurement.targets})
            run.metrics({"targets met": sum(t.met for t in measurement.targets) / len(targets)})
        run.text("notes.txt", "\n".join((measurement.title, *measurement.notes)))


def _target(target: Any) -> dict[str, Any]:
    return {"target": target.name, "measured": target.value, "at least": target.at_least, "met": bool(target.met)}


def _report(name: str, measurement: Measurement, quick: bool) -> dict[str, Any]:
    return {
        "benchmark": name,
        "title": measurement.title,
        "quick": quick,
        "rows": [dict(row) for row in measurement.rows],
        "targets": [_target(target) for target in measurement.targets],
        "notes": list(measurement.notes),
    }


def _print(name: str, measurement: Measurement, quick: bool) -> None:
    show([dict(row) for row in measurement.rows], False, title=f"{name}: {measurement.title}")
    for target in measurement.targets:
        verdict = "met   " if target.met else "missed"
        say(f"{verdict}  {target.name}: {target.value:.4g} (at least {target.at_least:.4g})")
    say(*measurement.notes)
    if quick and measurement.targets:
        say("sizes of --quick: run without it to evaluate targets")
    say("")
