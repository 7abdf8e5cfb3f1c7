"""`twingap rul`: remaining life along a run."""

from __future__ import annotations

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
    """What the machine did while rows are missing."""

    running = "running"
    stopped = "stopped"


_SHOWN = 15


def rul(
    recordset: Annotated[
        Path, typer.Argument(metavar="RECORDSET", help="Records of one run with time_s; speed_rpm 0 is a stop.")
    ],
    out: Annotated[Path, typer.Option(metavar="rul.csv", help="Where the estimates are written, a row a record.")],
    limit: Annotated[
        float | None,
        typer.Option(help="Peak to peak at which life ends, in the unit of the records, at whatever speed.", min=0.0),
    ] = None,
    limit_ratio: Annotated[
        float,
        typer.Option(
            help="Where no --limit is given: life ends at this many times the healthy peak to peak at the same speed."
        ),
    ] = 10.0,
    healthy_rows: Annotated[
        int, typer.Option(help="Rows at the beginning, the machine running, that count as healthy.", min=8)
    ] = 60,
    false_alarm: Annotated[
        float, typer.Option(help="Chance of a false alarm within 2000 healthy rows.", min=1e-6, max=0.49)
    ] = 0.01,
    gaps: Annotated[
        Gaps, typer.Option(help="Whether the machine ran while rows are missing: for more than three times the usual.")
    ] = Gaps.running,
    prior: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RUN",
            help="A run of such a bearing to its end (a record set), or a table of runs with the columns record, "
            "life_revolutions, after_anomaly_revolutions, end_ratio. May be given several times. With it there are "
            "estimates before the anomaly, and intervals are as wide as runs given as record sets would have needed.",
        ),
    ] = None,
    group: Annotated[
        str | None, typer.Option(help="Whose records are the run, where RECORDSET holds several bearings.")
    ] = None,
    effects: Effects = None,
    seed: AnySeed = 0,
    as_json: Json = False,
) -> None:
    """Remaining life along a run to failure: revolutions, and time with a 90 % interval.

    Each row uses only the records up to its own time. Peak to peak is divided by its healthy value at the same speed,
    learnt from the first rows; an alarm is given when it stays above what healthy rows show; from then on laws of
    growth are weighed by what was seen. Remaining time is what the remaining revolutions take at the row's own speed.
    Intervals are calibrated on simulated runs of many growth laws. Where the first rows are not shown to be healthy and
    no --limit is given, that is said, and the lower end of the interval is 0.

    rul.csv has the columns record, anomaly (0 or 1), remaining_revolutions, remaining_time_s, remaining_time_s_lo and
    remaining_time_s_hi, rows in order of time; estimates are empty before the anomaly unless --prior is given.
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
    taken: list[str] = []
    with replacing(out) as table:
        ended: list[tuple[str, Outcome]] = []
        for path in prior or ():
            ended += [(f"--prior {path}", outcome) for outcome in _outcomes(path, options, recordset, run.unit, taken)]
            refuse_repeats(ended)
        before = [outcome for _, outcome in ended]
        learnt = prior_from(before) if before else None
        with progress(f"{run.name}: remaining life") as shown:
            found = follow(run, options, learnt, progress=shown.share)
        refuse_repeats(ended, found.outcome)
        rows = found.rows()
        write_table(table, rows, COLUMNS)
    notes = [*found.notes, _meaning(options, run.unit), *taken]
    if (usual := usual_end(before)) is not None:
        notes.append(f"the runs given by --prior ended at {usual:.3g} times their healthy peak to peak (median)")
    if learnt is not None and learnt.widening != 1:
        notes.append(
            f"intervals of this run's growth are {learnt.widening:.2g} times as wide, in logarithms, as they are "
            "without --prior"
        )
    if learnt is not None:
        wide = "" if learnt.joined_widening == 1 else f", intervals of both {learnt.joined_widening:.2g} times as wide"
        notes.append(f"growth counts {learnt.growth_weight:g}, lives of other runs {1 - learnt.growth_weight:g}{wide}")
    if len({row.speed_rpm for row in run.rows if row.speed_rpm > 0}) > 1:
        notes.append("speed varies: remaining time is at each row's own speed, so it moves with it; revolutions do not")
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


def _outcomes(path: Path, options: LifeOptions, recordset: Path, unit: str, notes: list[str]) -> list[Outcome]:
    """What runs that ended say: a table of them, or one as a record set, whose unit may be another; that is noted."""
    from dataclasses import replace

    from twingap.errors import TwingapError
    from twingap.prognosis.follow import REACHED, follow
    from twingap.prognosis.outcomes import read_outcomes
    from twingap.prognosis.run_records import in_unit, read_run

    if not path.is_dir():
        if not path.is_file():
            raise TwingapError("no such run", where=path, mend="name a record set or a table of runs")
        return read_outcomes(path)
    run = read_run(path, several="give each run to --prior as a record set of its own")
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
            notes.append(f"units are unknown: those of {path} are taken to be in the unit of --limit")
        options = replace(options, limit=limit)
    with progress(f"{run.name}: prior") as shown:
        found = follow(run, options, progress=shown.share)
    kept = [*run.notes, *(note for note in found.notes if note.startswith(REACHED))]
    notes += [f"--prior {path}: {note}" for note in kept]
    return [found.outcome]


def _meaning(options: LifeOptions, unit: str) -> str:
    """What the numbers mean, in a line."""
    if options.limit is not None:
        end = (
            f"{options.limit:g} {unit}".strip()
            + " peak to peak, reached first at the speed of the greatest healthy amplitude (--limit)"
        )
    else:
        end = (
            f"{options.limit_ratio:g} times the healthy peak to peak (--limit-ratio; or --limit in the records' unit), "
            "and sooner than is said here if they were damaged: amplitude cannot tell damage that rests from health"
        )
    rule = options.rule
    return (
        f"the first {options.healthy_rows} rows of the running machine count as healthy (--healthy-rows): amplitude "
        f"and alarms are relative to them; life ends at {end}; an alarm is false in {rule.false_alarm:g} of runs of "
        f"{rule.horizon_rows} independent "
        "healthy rows; 90 % intervals are calibrated on simulated runs, and hold for growth that is like one of those"
    )
