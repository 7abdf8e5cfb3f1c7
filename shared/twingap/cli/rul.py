"""`twingap rul`: remaining life along a run."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twingap.cli.options import AnySeed, Effects, Json, refuse_overwriting, say_json, show, wrote
from twingap.cli.progress import progress

if TYPE_CHECKING:
    from twingap.prognosis.estimate import LifeOptions
    from twingap.prognosis.outcomes import Outcome


class Gaps(StrEnum):
    """State of the machine during gaps in the rows."""

    running = "running"
    stopped = "stopped"


_SHOWN = 15
"""Rows of the table on the terminal."""


def rul(
    recordset: Annotated[
        Path, typer.Argument(metavar="RECORDSET", help="Records of one run with time_s; speed_rpm 0 is a stop.")
    ],
    out: Annotated[Path, typer.Option(metavar="rul.csv", help="File for the estimates, one row per record.")],
    limit: Annotated[
        float | None,
        typer.Option(help="Peak to peak at which life ends, in the unit of the records, at any speed.", min=0.0),
    ] = None,
    limit_ratio: Annotated[
        float,
        typer.Option(
            help="Without --limit: multiple of the healthy peak to peak at the same speed at which life ends."
        ),
    ] = 10.0,
    healthy_rows: Annotated[int, typer.Option(help="First rows of the running machine, assumed healthy.", min=8)] = 60,
    false_alarm: Annotated[
        float, typer.Option(help="Probability of a false alarm within 2000 healthy rows.", min=1e-6, max=0.49)
    ] = 0.01,
    gaps: Annotated[
        Gaps,
        typer.Option(help="Whether the machine ran during gaps of more than three times the usual spacing of rows."),
    ] = Gaps.running,
    prior: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RUN",
            help="A run to failure of a bearing of the same kind (a record set), or a table of runs with the columns "
            "record, life_revolutions, after_anomaly_revolutions, end_ratio; repeatable. It gives estimates before the "
            "anomaly and adjusts the width of intervals to the errors on these runs.",
        ),
    ] = None,
    group: Annotated[
        str | None, typer.Option(help="Group of the run, where RECORDSET contains several bearings.")
    ] = None,
    alone: Annotated[
        bool,
        typer.Option("--alone", help="Leave out the other groups of RECORDSET (a prior unless --prior is given)."),
    ] = False,
    effects: Effects = None,
    seed: AnySeed = 0,
    as_json: Json = False,
) -> None:
    """Estimate remaining life along a run to failure: revolutions, and time with a 90 % interval.

    The estimate of a row uses only the records up to its time. Peak to peak is divided by its healthy value at the same
    speed, estimated from the first rows. An alarm is given when it stays above the healthy scatter; from then on,
    growth laws are weighted by how well they explain the amplitudes. Remaining time is that of the remaining
    revolutions at the speed of the row. Intervals are calibrated on simulated runs of many growth laws. Where the first
    rows may not have been healthy and no --limit is given, a note says so, and the lower end of the interval is 0.

    rul.csv has the columns record, anomaly (0 or 1), remaining_revolutions, remaining_time_s, remaining_time_s_lo and
    remaining_time_s_hi, rows in order of time. Estimates are empty before the anomaly unless there are other runs:
    those of --prior, or with --group the other groups of RECORDSET that end with an anomaly. Lives at other loads
    (load_n) are converted by ISO 281.
    """
    import math
    import sys

    from twingap.errors import TwingapError
    from twingap.files import replacing
    from twingap.prognosis.anomaly import AnomalyRule
    from twingap.prognosis.estimate import LifeOptions
    from twingap.prognosis.follow import COLUMNS, follow
    from twingap.prognosis.outcomes import prior_from, refuse_repeats, usual_end
    from twingap.prognosis.run_records import read_run
    from twingap.records.table import write_table

    if limit is not None and not (math.isfinite(limit) and limit > 0):
        raise TwingapError(f"limit = {limit:g}, a positive amplitude expected", where="--limit")
    if not (math.isfinite(limit_ratio) and limit_ratio > 1):
        raise TwingapError(f"ratio = {limit_ratio:g}, more than 1 expected", where="--limit-ratio")
    refuse_overwriting(out, recordset, *(prior or ()))
    options = LifeOptions(limit, limit_ratio, healthy_rows, AnomalyRule(false_alarm), gaps.value)
    run = read_run(recordset, group)
    prior_notes: list[str] = []
    with replacing(out) as table:
        ended: list[tuple[str, Outcome]] = []
        for path in prior or ():
            ended += [
                (f"--prior {path}", outcome) for outcome in _outcomes(path, options, recordset, run.unit, prior_notes)
            ]
            refuse_repeats(ended)
        if prior is None and not alone:
            ended = _of_the_set(recordset, group, options, prior_notes)
        before = [outcome for _, outcome in ended]
        load_n = run.load_n(healthy_rows)
        learnt = prior_from(before, load_n) if before else None
        with progress(f"{run.name}: remaining life") as shown:
            found = follow(run, options, learnt, progress=shown.share)
        refuse_repeats(ended, found.outcome)
        rows = found.rows()
        write_table(table, rows, COLUMNS)
    notes = [*found.notes, _meaning(options, run.unit), *prior_notes]
    if len(rows) <= healthy_rows and learnt is None:
        notes.insert(
            0, f"no row has an estimate: the run has {len(rows)} rows, and the first {healthy_rows} are taken as "
            "healthy; give a smaller --healthy-rows"
        )  # fmt: skip
    if before and load_n and any(outcome.at_load(load_n).life != outcome.life for outcome in before):
        notes.append(f"lives of other runs are converted to {load_n:g} N (ISO 281, exponent 3)")
    if (usual := usual_end(before)) is not None:
        notes.append(f"the other runs ended at {usual:.3g} times their healthy peak to peak (median)")
    if learnt is not None and learnt.widening != 1:
        notes.append(
            f"intervals by growth are {learnt.widening:.2g} times as wide, in logarithms, as without other runs"
        )
    if learnt is not None:
        wide = "" if learnt.joined_widening == 1 else f", intervals {learnt.joined_widening:.2g} times as wide"
        notes.append(
            f"after an anomaly, lives of other runs are pooled with growth of weight {learnt.growth_weight:g}{wide}"
        )
    if len({row.speed_rpm for row in run.rows if row.speed_rpm > 0}) > 1:
        notes.append("speed varies: remaining time is at the speed of each row and varies with it; revolutions do not")
    if as_json:
        last = rows[-1]
        about: dict[str, Any] = {
            "out": str(out), "run": run.name, "rows": len(rows), "alarm": found.alarm, "onset": found.onset,
            "last": last, "records": rows, "notes": notes,
        }  # fmt: skip
        say_json(about)
    else:
        places = sorted({round(i * (len(rows) - 1) / (_SHOWN - 1)) for i in range(_SHOWN)})
        show([rows[i] for i in places], False, title=f"{run.name}: {len(places)} of {len(rows)} rows")
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    wrote(out, as_json=as_json)


def _of_the_set(
    recordset: Path, group: str | None, options: LifeOptions, notes: list[str]
) -> list[tuple[str, Outcome]]:
    """Outcomes of the other groups of a record set that end with an anomaly; appends a note on which are used."""
    from twingap.errors import TwingapError
    from twingap.prognosis.follow import follow
    from twingap.prognosis.run_records import other_groups, read_run

    ended, left_out = [], []
    for name in other_groups(recordset, group):
        try:
            with progress(f"{name}: prior") as shown:
                found = follow(read_run(recordset, name), options, progress=shown.share)
        except TwingapError:
            left_out.append(name)
            continue
        if found.alarm is None:
            left_out.append(name)
        else:
            ended.append((f"group {name!r}", replace(found.outcome, name=name)))
    if ended:
        names = ", ".join(where.removeprefix("group ") for where, _ in ended[:8])
        notes.append(f"groups {names} end with an anomaly and are taken as ended runs of the same kind (--alone: not)")
    if left_out:
        them = ", ".join(repr(name) for name in left_out[:8])
        notes.append(f"groups without an anomaly at their end are no ended runs and not used: {them}")
    return ended


def _outcomes(path: Path, options: LifeOptions, recordset: Path, unit: str, notes: list[str]) -> list[Outcome]:
    """Outcomes of ended runs, from a table or from one record set; appends notes, for instance on units."""
    from twingap.errors import TwingapError
    from twingap.prognosis.follow import REACHED, follow
    from twingap.prognosis.outcomes import read_outcomes
    from twingap.prognosis.run_records import in_unit, read_run

    if not path.is_dir():
        if not path.exists():
            raise TwingapError("does not exist", where=path, mend="name a record set or a table of runs")
        return read_outcomes(path)
    run = read_run(path, several="give each run to --prior as a separate record set")
    if path.samefile(recordset):
        raise TwingapError(
            "is the run whose remaining life is estimated, and its end would enter the estimate",
            where=f"--prior {path}", mend="leave it out of --prior",
        )  # fmt: skip
    if options.limit is not None:
        limit = in_unit(options.limit, unit, run.unit)
        if limit is None:
            raise TwingapError(
                f'records are in unit "{run.unit}", --limit in "{unit}": an unknown unit cannot be converted',
                where=f"--prior {path}", mend="state the unit in its recordset.toml, or use --limit-ratio",
            )  # fmt: skip
        if unit != run.unit:
            notes.append(f"--limit {options.limit:g} {unit} is {limit:.4g} {run.unit} in the records of {path}")
        elif not unit:
            notes.append(f"units are unknown: those of {path} are assumed to be the unit of --limit")
        options = replace(options, limit=limit)
    with progress(f"{run.name}: prior") as shown:
        found = follow(run, options, progress=shown.share)
    kept = [*run.notes, *(note for note in found.notes if note.startswith(REACHED))]
    notes += [f"--prior {path}: {note}" for note in kept]
    return [found.outcome]


def _meaning(options: LifeOptions, unit: str) -> str:
    """Note on the meaning of the estimates."""
    if options.limit is not None:
        end = (
            f"{options.limit:g} {unit}".strip()
            + " peak to peak, reached first at the speed of the largest healthy amplitude (--limit)"
        )
    else:
        end = (
            f"{options.limit_ratio:g} times the healthy peak to peak (--limit-ratio; or --limit in the records' unit), "
            "and earlier than estimated if they were damaged, which constant amplitude does not show"
        )
    rule = options.rule
    return (
        f"the first {options.healthy_rows} rows of the running machine are assumed healthy (--healthy-rows): "
        f"amplitude and alarms are relative to them; life ends at {end}; an alarm is false in {rule.false_alarm:g} "
        f"of runs of {rule.horizon_rows} independent healthy rows; 90 % intervals are calibrated on simulated runs "
        "and hold for similar growth"
    )
