"""`twingap gap`: diagnosis of the gap between records and a twin."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from twingap.cli.options import Effects, Json, Seed, TrackingUri, say, say_json, show, wrote
from twingap.cli.progress import progress
from twingap.cli.tracking import Track, Tracking

if TYPE_CHECKING:
    from twingap.gap.report.model import GapReport


def gap(
    recordset: Annotated[Path, typer.Argument(metavar="RECORDSET", help="Records of the machine.")],
    twin: Annotated[Path, typer.Option(metavar="TWIN.toml", help="Twin of the machine.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for gap.json and report.html.")],
    sim: Annotated[
        Path | None,
        typer.Option(metavar="RECORDSET", help="Your own simulated records instead of those of the built-in twin."),
    ] = None,
    export: Annotated[
        bool,
        typer.Option("--export", help="Also write the record sets DIR/sim_before, DIR/sim_after and DIR/sim_closest."),
    ] = False,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Leave out the closest twin and what each group of effects closes."),
    ] = False,
    track: Track = True,
    tracking_uri: TrackingUri = None,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Diagnose where records and twin differ, which effects the twin lacks, and how much of the gap they close."""
    from twingap.errors import TwingapError
    from twingap.files import try_outputs
    from twingap.gap.report.files import to_json
    from twingap.records.folder import read_record_set
    from twingap.twins.twin_file import read_twin

    if sim is not None and sim.resolve() == recordset.resolve():
        raise TwingapError("simulated and real records are the same", where=f"--sim {sim}")
    if out.resolve() in (recordset.resolve(), None if sim is None else sim.resolve()):
        raise TwingapError("is a record set", where=f"--out {out}", mend="name another folder")
    read_twin(twin)  # reports an invalid file before slow imports
    records = read_record_set(recordset)
    simulated = None if sim is None else read_record_set(sim)
    tracking = Tracking("gap", track, tracking_uri)
    twins = ("closest.toml",) if not quick and simulated is None else ()
    exports = ("sim_before", "sim_after", "sim_closest")[: 2 if quick else 3] if export else ()
    try_outputs(out, ("gap.json", "report.html", *twins), exports)
    with progress("loading") as shown:
        from twingap.gap import diagnose
        from twingap.gap.report.tracking import track_report

        found = diagnose(records, twin, seed=seed, sim=simulated, quick=quick, progress=shown.share)
        paths = found.write(out, export=export, progress=shown.share)
    about = found.report
    tracking.log(lambda tracker: track_report(tracker, about, paths[:2]))
    if as_json:
        say_json(to_json(about))
    else:
        _print(about)
    wrote(*paths, as_json=as_json)


def _interval(ci: tuple[float, float]) -> str:
    """Text of an interval of a closure, which states ends at the bounds of closures."""
    from twingap.gap.distance.closure import CLOSURE_BOUNDS

    low, high = (f"{round(100 * end)}%" for end in ci)
    low += " or less" * (ci[0] <= CLOSURE_BOUNDS[0])
    high += " or more" * (ci[1] >= CLOSURE_BOUNDS[1])
    return f"{low} to {high}"


def _print(report: GapReport) -> None:
    """Print the verdict, the most probable candidates and the metrics."""
    from twingap.gap.report.advice import next_steps, only_together, place_words
    from twingap.gap.report.formats import closure

    say(report.sentence)
    if report.closest_sentence:
        say(report.closest_sentence)
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
                "closes": "cannot be added" if c.acts is not None else closure(c.closure),
                "90% interval": "" if c.acts is not None else _interval(c.closure_ci),
                "named": "yes" if c.effect in report.verdict.effects else "",
            }
            for c in shown
        ]
        show(rows, False, title="Which effect is missing")
        if together := only_together(report):
            say(together)
    if report.closest.attribution:
        rows = [
            {
                "group": share.group,
                "closes": f"{round(100 * share.share)}%",
                "90% interval": _interval(share.share_ci),
                "p": f"{share.p_value:.2g}",
                "effects": ", ".join(e.effect for e in share.effects),
            }
            for share in report.closest.attribution
        ]
        show(rows, False, title="What the closest twin closes")
    if report.metrics:
        closest = {m.metric: m.after for m in report.closest.metrics}
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
