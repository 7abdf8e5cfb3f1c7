"""`twingap health`: health indicator of a run, comparison of degradation models, figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twingap.cli.options import Effects, Json, Seed, say, say_json, show, wrote
from twingap.cli.progress import progress

if TYPE_CHECKING:
    from twingap.prognosis.health_indicator import Run


def health(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDSET_OR_FEATURES.csv",
            help="Records with time_s, or a table with a column time_s and a column of numbers per feature.",
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for indicator, tables and figure.")],
    limit: Annotated[
        float | None,
        typer.Option(
            help="Level at which life ends, for remaining life: in the feature's own unit where the indicator is a "
            "feature, else in healthy standard deviations.",
            show_default=False,
        ),
    ] = None,
    indicator: Annotated[
        str | None, typer.Option(help="Name of a feature or fusion feature; the most suitable when absent.")
    ] = None,
    healthy: Annotated[int, typer.Option(help="First records, assumed healthy.", min=3)] = 30,
    group: Annotated[str | None, typer.Option(help="Group of the run, where there are several.")] = None,
    robust: Annotated[bool, typer.Option("--robust", help="Give outliers less weight.")] = False,
    level: Annotated[float, typer.Option(help="Coverage of the intervals.", min=0.5, max=0.99)] = 0.9,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Health indicator of a run, and comparison of degradation models with intervals.

    The indicator is normalised on the healthy beginning and selected by monotonicity, correlation with time and
    robustness on this run. Exponential, power, polynomial and combined power curves are compared by information
    criteria and by their error on records after each tenth of the run. Intervals hold if the model is correct.

    Writes indicator.csv, candidates.csv, models.csv, degradation.json and degradation.png to DIR.
    """
    import numpy as np

    from twingap.files import kind_of, replacing_folder
    from twingap.prognosis.degradation_models import MODELS
    from twingap.prognosis.degrade import DegradeOptions
    from twingap.prognosis.degrade import degrade as run_all
    from twingap.prognosis.health_indicator import SILENT, Run, negative_rms, running

    options = DegradeOptions(healthy, indicator, limit, robust=robust, level=level)
    # The folder is created at first, and filled only after success.
    with replacing_folder(out) as folder:
        is_folder = kind_of(source) == "folder"
        run, notes = _from_records(source, group) if is_folder else _from_table(source, group)
        if (below := negative_rms(run)) is not None:
            notes.append(
                f"rms is below 0 in {below} of {run.time_s.size} records (decibels?): none is left out as silent"
            )
        awake = running(run, healthy)
        if not awake.all():
            silent = [f"{t:g} s" for t in run.time_s[~awake][:4]] + ["..."] * (int((~awake).sum()) > 4)
            notes.append(
                f"{int((~awake).sum())} of {run.time_s.size} records are silent (RMS under {SILENT:g} of the healthy "
                f"one: machine stopped, or sensor off) and are left out: {', '.join(silent)}"
            )
            run = Run(run.name, run.time_s[awake], run.names, run.features[awake])
        with progress("fitting", len(MODELS)) as shown:
            found = run_all(run, options, np.random.default_rng(seed), progress=shown.step)
        if found.candidates.constant:
            notes.append(f"constant in the healthy records, left out: {', '.join(found.candidates.constant)}")
        if indicator is None:
            notes.append(
                f"{found.indicator!r} was selected on the complete run; state it with --indicator for later records"
            )
        if limit is None:
            notes.append("no remaining life without --limit, the level at which life ends")
        notes += found.notes
        tables = {
            "indicator": found.indicator_rows(), "candidates": found.candidate_rows(), "models": found.model_rows(),
        }  # fmt: skip
        for name, rows in tables.items():
            _write_csv(folder / f"{name}.csv", rows)
        about = {
            "out": str(out), "run": run.name, "records": int(run.time_s.size), "seed": seed,
            "indicator": found.indicator, "healthy_rows": healthy, "robust": robust, "level": level,
            "limit": limit, "limit_in_indicator": found.limit, "preferred": found.preferred,
            "candidates": tables["candidates"],
            "models": [
                row | {
                    **found.equations[row["model"]].about(),
                    "errors": [{"share": e.share, "rmse_later": e.rmse_rest, "rmse_next_tenth": e.rmse_next,
                                "records": e.rows} for e in m.errors],
                }
                for row, m in zip(tables["models"], found.models.values(), strict=True)
            ],
            "notes": notes,
        }  # fmt: skip
        _write_json(folder / "degradation.json", {k: v for k, v in about.items() if k != "out"})
        from twingap.prognosis.degradation_figure import write_figure  # imports matplotlib

        write_figure(folder / "degradation.png", found)
    if as_json:
        say_json(about)
    else:
        columns = ("model", "r2", "aicc_ar1_above_least", "bic_ar1_above_least", "rmse_later_records")
        life = ("remaining_time_s", "remaining_time_s_lo", "remaining_time_s_hi") if limit is not None else ()
        rows = [{key: row[key] for key in (*columns, *life)} for row in tables["models"]]
        show(rows, False, title=f"{run.name}: {run.time_s.size} records, indicator {found.indicator}")
        say(f"{found.preferred}: {found.equations[found.preferred].text()}")
        for note in notes:
            say(f"note: {note}")
    names = ("indicator.csv", "candidates.csv", "models.csv", "degradation.json", "degradation.png")
    wrote(*(out / name for name in names), as_json=as_json)


def _from_records(source: Path, group: str | None) -> tuple[Run, list[str]]:
    """Features of a record set's records."""
    from twingap.errors import TwingapError
    from twingap.prognosis.health_indicator import features_of
    from twingap.prognosis.one_run import listed, side_by_side
    from twingap.records.folder import read_record_set
    from twingap.records.table import read_table

    records = read_record_set(source, turning=True)
    notes = []
    if still := len(read_table(source / "records.csv", ("record",))) - len(records):
        notes.append(f"the machine stands still in {still} rows (speed_rpm 0), which are left out")
    conditions = records.conditions
    # Without a column `group`, each record is its own group.
    named = [str(c.group) for c in conditions] if any(c.group != c.name for c in conditions) else []
    if group is not None:
        if not named:
            raise TwingapError(f"no column group to find {group!r} in", where=source, mend="leave out --group")
        if group not in named:
            raise TwingapError(f"no group {group!r}", where=source, mend=f"use one of {listed(named)}")
        records = records.select(lambda c: c.group == group)
    elif named and side_by_side((c.group for c in conditions), (c.time_s for c in conditions)):
        what = f"contains {len(set(named))} runs that overlap in time: {listed(named)}"
        raise TwingapError(what, where=source, mend="select one with --group")
    elif (count := len(set(named))) > 1:
        notes.append(f"{count} groups that follow one another in time: assumed to be recordings of one run")
    speeds = {round(c.speed_rpm, -1) for c in records.conditions}
    if len(speeds) > 1:
        notes.append(f"speed varies ({min(speeds):g} to {max(speeds):g} rpm), and features may vary with it")
    with progress("features", len(records)) as shown:
        return features_of(records, group or records.name, progress=shown.step, notes=notes), notes


def _from_table(source: Path, group: str | None) -> tuple[Run, list[str]]:
    """Features from a table."""
    from twingap.prognosis.feature_table import read_feature_table

    return read_feature_table(source, group=group)


def _write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    import csv

    from twingap.records.table import as_text

    with path.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(rows[0])
        table.writerows([as_text(value, path.name) for value in row.values()] for row in rows)


def _write_json(path: Path, value: object) -> None:
    import json

    from twingap.provenance import plain

    path.write_text(json.dumps(plain(value), indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
