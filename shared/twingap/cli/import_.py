"""`twingap import`: exports of data loggers as a record set."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from twingap.cli.options import AnySeed, Effects, Json, say, say_json, show, wrote
from twingap.cli.progress import steps
from twingap.errors import TwingapError

if TYPE_CHECKING:
    from twingap.data.importing import Understood


def _by_note(found: Sequence[Understood]) -> list[str]:
    """Notes on the files, those of several files once."""
    files = list(dict.fromkeys(record.channel.path.name for record in found))
    said: dict[str, list[str]] = {}
    for record in found:
        for note in record.notes:
            said.setdefault(note, []).append(record.channel.path.name)
    return [f"{_of(names, len(files))}: {note}" for note, names in said.items()]


def _of(names: Sequence[str], count: int) -> str:
    """Names of a few files, the number of many."""
    names = list(dict.fromkeys(names))
    if len(names) == count > 1:
        return f"all {count} files"
    return ", ".join(names) if len(names) < 4 else f"{len(names)} files, such as {names[0]}"


def import_(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILES", help="Files of samples, or folders of them.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="SET", help="New folder for the record set.", show_default=False)
    ] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option(help="A channel, by name or index; repeat for several. Default: all but time, speed and tacho."),
    ] = None,
    names: Annotated[
        str | None,
        typer.Option(
            help="Pattern of the file names, such as '{fault}_{speed_rpm:d}rpm.csv'. Fields: record, fault, speed_rpm, "
            "load_n, time_s, fs_hz, group, and others, which become columns. ':d' whole numbers, ':g' numbers."
        ),
    ] = None,
    fs_hz: Annotated[
        float | None, typer.Option("--fs-hz", help="Sampling rate, Hz. Default: as the files state it.")
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of the samples, m/s^2 or g. Default: as the files state it.")
    ] = None,
    scale: Annotated[float, typer.Option(help="Factor on all samples, such as 10 for 100 mV/g.")] = 1.0,
    speed_rpm: Annotated[float | None, typer.Option("--speed-rpm", help="Shaft speed of all records.")] = None,
    speed_channel: Annotated[
        str | None,
        typer.Option(
            help="Channel that holds the speed in rev/min. Default: one in rpm, where nothing else states the speed."
        ),
    ] = None,
    tacho_channel: Annotated[str | None, typer.Option(help="Channel that holds the pulses of a tacho.")] = None,
    pulses_per_turn: Annotated[int, typer.Option(help="Pulses of the tacho per shaft turn.", min=1)] = 1,
    fault: Annotated[
        str | None, typer.Option(help="Fault of all records: healthy, inner, outer, ball or cage.")
    ] = None,
    load_n: Annotated[float | None, typer.Option("--load-n", help="Radial load of all records, N.")] = None,
    bearing: Annotated[
        str | None,
        typer.Option(
            help="Bearing by name (see `twingap bearings`), or its geometry: number of rollers, roller and pitch "
            "diameter in mm, contact angle in degrees, such as 9,7.94,39.04,0."
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the record set. Default: that of the folder.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only show what is understood.")] = False,
    effects: Effects = None,
    seed: AnySeed = 0,
    as_json: Json = False,
) -> None:
    """Import exports of data loggers as a record set, with a preview of what was understood.

    Separators, decimal commas, units, rates and time axes are detected in the files. What they do not state is given
    by options. The folder appears when all records are written.
    """
    from twingap.data.importing import (
        ImportOptions,
        bearing_of,
        files_of,
        finite_positive,
        notes_on_groups,
        records_of,
        understand,
        unit_of,
    )
    from twingap.records.folder import write_records
    from twingap.records.model import UNITS

    if out is None and not dry_run:
        raise TwingapError("no folder is named", where="--out", mend="name one, or use --dry-run")
    if unit is not None and unit not in UNITS:
        raise TwingapError(f"unit {unit!r}", where="--unit", mend="use m/s^2 or g")
    for value, option in ((fs_hz, "--fs-hz"), (speed_rpm, "--speed-rpm"), (abs(scale), "--scale")):
        finite_positive(value, option)
    geometry = None if bearing is None else bearing_of(bearing)
    options = ImportOptions(
        tuple(channel or ()), unit, scale, fs_hz, speed_rpm, speed_channel, tacho_channel, pulses_per_turn, names,
        fault, load_n,
    )  # fmt: skip
    found = understand(files_of(files), options)
    rows = [record.row() for record in found]
    notes = [*_by_note(found), *notes_on_groups(found)]
    if geometry is None:
        notes.append("no bearing is stated: add --bearing, which `twingap gap` and `classify` need")
    units = {record.unit for record in found}
    if len(units) > 1:
        held = ", ".join(sorted(u or "unknown units" for u in units))
        notes.append(f"records are in {held}: written in {unit_of(found) or 'the units they have'}")
    if not dry_run:
        assert out is not None
        rates = [record.condition.fs_hz for record in found]
        write_records(
            out, name or out.resolve().name, unit_of(found), geometry, max(dict.fromkeys(rates), key=rates.count),
            steps(records_of(found), "import", len(found)),
        )  # fmt: skip
    if not as_json:
        common = [key for key in rows[0] if any(row.get(key) is not None for row in rows)]
        show(
            [{key: row.get(key) for key in common} for row in rows],
            False,
            title=f"{len(rows)} record{'s' * (len(rows) != 1)} understood",
        )
        for note in notes:
            say(f"note: {note}")
    if as_json:
        say_json({"out": None if dry_run else str(out), "unit": unit_of(found), "records": rows, "notes": notes})
    if not dry_run and out is not None:
        wrote(out, as_json=as_json)
