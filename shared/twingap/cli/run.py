"""`twingap run`: tables and figures of a paper."""

from __future__ import annotations

import enum
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from twingap.cli.options import Effects, Json, Seed, TrackingUri, say, say_json, show, wrote
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
    backend: Annotated[str, typer.Option(help="Where trainings run: loky (local processes) or dask.")] = "loky",
    address: Annotated[str | None, typer.Option(help="Address of a running dask cluster.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of tables, figures and results [.twingap/PAPER].")] = None,
    root: Annotated[Path | None, typer.Option(help="Data root; TWINGAP_DATA when absent.")] = None,
    effects: Effects = None,
    seed: Seed = 0,
    tracking_uri: TrackingUri = None,
    json: Json = False,
) -> None:
    """Reproduce the tables and figures of a paper; tracked, and resumable after an interruption."""
    from twingap.track import MlflowTracker, state_folder

    pipeline = import_module(f"papers.{_FOLDERS[paper]}.pipeline")
    tracker = MlflowTracker(tracking_uri, paper.value)
    try:
        with progress("reading") as shown:
            outcome = pipeline.run(
                profile.value,
                out=out or state_folder() / paper.value,
                root=root,
                seed=seed,
                backend=backend,
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
        _PRINT[paper](outcome)
        say(f"MLflow run {outcome.run_id} in {tracker.uri}; show it with: twingap ui")
    wrote(outcome.out / "tables", outcome.out / "figures", as_json=json)


def _print1(outcome: Any) -> None:
    columns = ("twin", "bearing", "model", "seeds", "rmse_min", "std")
    rows = [{name: row[name] for name in columns} for row in outcome.rows]
    show(rows, False, f"RMSE of remaining time, minutes: {outcome.title}")
    if outcome.missing:
        say(f"left out, since data are not available: {', '.join(outcome.missing)}")
    count = sum(len(case.trainings) for case in outcome.cases)
    say(f"{count} trainings: {outcome.computed} run now, {count - outcome.computed} from earlier runs")


def _print2(outcome: Any) -> None:
    for title, rows in outcome.shown().items():
        show(rows, False, title)
    if outcome.missing:
        say(f"left out: {', '.join(outcome.missing)}")


def _print3(outcome: Any) -> None:
    from papers.paper3_zoa_dann import tables, tables_comparison

    for task, rows in tables.shown(outcome.rows).items():
        show(rows, False, f"{task}: trained on the contact twin, evaluated on {outcome.target.title}")
    for gain in tables.adaptation(outcome.tasks, outcome.options, outcome.target.title):
        low, high = (100 * gain[name] for name in ("low_95", "high_95"))
        say(
            f"DANN on the {gain['input'].replace('_', ' ')} adds {100 * gain['gain']:+.1f} points "
            f"(95 % interval {low:+.1f} to {high:+.1f}, {outcome.target.title})"
        )
    count = sum(len(result.trainings) for result in outcome.tasks)
    say(
        "accuracy of windows: mean ± std over seeds, and the 95 % interval for that mean; right: recordings, by vote;",
        "oracle: the best checkpoint by target labels, which no method can select",
        f"{count} trainings: {outcome.computed} run now, {count - outcome.computed} from earlier runs",
    )
    if outcome.comparison is not None:
        rows = tables_comparison.shown(outcome.comparison.tables)
        show(rows, False, "methods compared: accuracy of windows, %, label-free selection, mean over tasks")
        if outcome.comparison.missing:
            say(f"not available and left out: {', '.join(outcome.comparison.missing)}")
    if not outcome.target.real:
        say("no CWRU records available: for real ones, `twingap data fetch cwru` and set TWINGAP_DATA")


_FOLDERS: Final[Mapping[Paper, str]] = {
    Paper.paper1: "paper1_rul_varying_speed",
    Paper.paper2: "paper2_digital_twin",
    Paper.paper3: "paper3_zoa_dann",
}
_PRINT: Final[Mapping[Paper, Callable[[Any], None]]] = {
    Paper.paper1: _print1,
    Paper.paper2: _print2,
    Paper.paper3: _print3,
}
