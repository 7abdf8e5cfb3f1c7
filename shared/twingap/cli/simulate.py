"""`twingap simulate`: a twin's records for given conditions."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from twingap.cli.options import Effects, Json, Seed, say, say_json, show, wrote
from twingap.cli.progress import steps

if TYPE_CHECKING:
    from twingap.records import Condition
    from twingap.twins.twin_file import TwinSpec


class Device(Enum):
    """Where twins are integrated."""

    cpu = "cpu"
    cuda = "cuda"


def simulate(
    twin: Annotated[Path, typer.Argument(metavar="TWIN.toml", help="Twin to simulate.")],
    records: Annotated[
        Path,
        typer.Option(metavar="RECORDSET_OR_CSV", help="Conditions to simulate: a record set, or a table of them."),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for the record set.")],
    fs_hz: Annotated[float | None, typer.Option("--fs-hz", help="Sampling rate of CSV rows without one, Hz.")] = None,
    duration_s: Annotated[float | None, typer.Option("--duration-s", help="Length of CSV rows without one, s.")] = None,
    population: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Draw N machines from the spread of the twin's values over units, such as those of closest.toml; each "
            "has a record per condition, and the column unit names it.",
        ),
    ] = None,
    device: Annotated[
        Device, typer.Option(help="cuda: many records of a contact twin at once, on an NVIDIA GPU.")
    ] = Device.cpu,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Simulate the twin's records for the conditions (speed, fault, load, time) of a record set or a CSV."""
    from twingap.records.conditions import read_conditions
    from twingap.records.folder import write_records
    from twingap.twins.simulate import simulated
    from twingap.twins.twin_file import overruled, read_twin, scaled_for

    spec = read_twin(twin)
    stated = read_conditions(records, fs_hz=fs_hz, duration_s=duration_s)
    conditions = stated.conditions
    _refuse_unknown_faults(conditions, records)
    # The unit that the twin was identified in, else that of the record set, else m/s^2.
    unit = stated.unit if spec.identified is None else spec.identified.unit
    unit = "m/s^2" if unit is None else unit
    bearing = stated.bearing or spec.bearing
    if bearing is None:
        raise _no_bearing(twin, records)
    notes = [note] if (note := overruled(spec, stated.bearing)) else []
    notes += _without_amplitude(spec, conditions)
    spec, of_scale = scaled_for(spec, unit)
    made = simulated(spec, conditions, bearing, unit, seed, population, device.value)
    count = len(conditions) * (population or 1)
    write_records(out, f"{spec.model} twin", unit, bearing, None, steps(made, "simulate", count))
    rows = [
        {"fault": fault, "records": sum(c.fault == fault for c in conditions) * (population or 1)}
        for fault in dict.fromkeys(c.fault for c in conditions)
    ]
    if as_json:
        about = {
            "out": str(out), "records": count, "unit": unit, "seed": seed, "faults": rows,
            "notes": [*notes, *([of_scale] if of_scale else [])],
        }  # fmt: skip
        say_json(about)
    else:
        show(rows, False, title=f"{count} records of the {spec.model} twin")
        for note in notes:
            say(f"note: {note}")
    if of_scale:
        print(f"note: {of_scale}", file=sys.stderr)
    wrote(out, as_json=as_json)


def _without_amplitude(spec: TwinSpec, conditions: Iterable[Condition]) -> list[str]:
    """A note on faults whose impacts were not identified, unlike those of other faults."""
    stated = spec.parameters.get("impact_amplitude")
    if spec.identified is None or not stated:
        return []
    missing = dict.fromkeys(str(c.fault) for c in conditions if c.fault not in ("healthy", *stated))
    note = f"the twin was not identified with faults of {' and '.join(missing)}: their impacts have default amplitudes"
    return [note] if missing else []


def _refuse_unknown_faults(conditions: Iterable[Condition], where: Path) -> None:
    """Raise for a condition without a fault, which cannot be simulated."""
    from twingap.errors import TwingapError

    for condition in conditions:
        if condition.fault is None:
            raise TwingapError(
                "the fault is unknown, so the record cannot be simulated",
                where=f"{where}: record {condition.name!r}",
                mend="fill the column fault (healthy, inner, outer, ball, cage)",
            )


def _no_bearing(twin: Path, records: Path) -> Exception:
    from twingap.errors import TwingapError

    return TwingapError(
        f"the bearing's geometry is neither here nor in {twin}",
        where=records,
        mend="add a [bearing] table to the twin file (or to recordset.toml)",
    )
