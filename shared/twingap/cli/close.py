"""`twingap close`: effects added to a twin until nothing more closes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Effects, Json, Seed, refuse_overwriting, say, say_json, show, wrote
from twingap.cli.progress import progress


def close(
    recordset: Annotated[Path, typer.Argument(metavar="RECORDSET", help="Records of the machine.")],
    twin: Annotated[Path, typer.Option(metavar="TWIN.toml", help="What is already modelled.")],
    out: Annotated[
        Path, typer.Option(metavar="TWIN2.toml", help="The closest twin, with the effects that were found.")
    ],
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Diagnose, add the named effects, and diagnose again until no further effect closes anything.

    TWIN2.toml is the closest twin. Beside it, the folder TWIN2_gap has the report of the diagnosis that found it.
    """
    from twingap.files import replacing, try_outputs
    from twingap.records.folder import read_record_set
    from twingap.twins.twin_file import read_twin, write_twin

    read_twin(twin)  # a mistyped file is refused before anything slow is imported
    refuse_overwriting(out, twin, recordset)
    records, folder = read_record_set(recordset), out.with_name(f"{out.stem}_gap")
    try_outputs(folder, ("gap.json", "report.html"))
    with replacing(out) as text, progress("loading") as shown:
        from twingap.gap.closing import close as run

        way = run(records, twin, seed=seed, progress=shown.share)
        write_twin(text, way.twin)
        paths = way.closest.write(folder)
    rows = [
        {"step": k, "overall gap": gap, "named": ", ".join(found.report.verdict.effects), "added": ", ".join(added)}
        for k, (gap, found, added) in enumerate(zip(way.gaps, way.diagnoses, (*way.added, ()), strict=True), 1)
    ]
    if as_json:
        say_json({"sentence": way.sentence, "closure": way.closure, "steps": rows})
    else:
        say(way.sentence)
        show(rows, False, title="Steps")
    wrote(out, *paths, as_json=as_json)
