"""`twingap identify`: a twin's free parameters from records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Effects, Json, Seed, refuse_overwriting, say, say_json, show, wrote
from twingap.cli.progress import progress


def identify(
    twin: Annotated[Path, typer.Argument(metavar="TWIN.toml", help="Twin; absent parameters are free.")],
    recordset: Annotated[Path, typer.Argument(metavar="RECORDSET", help="Records to identify them from.")],
    out: Annotated[Path, typer.Option(metavar="TWIN2.toml", help="The identified twin.")],
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for figures of the fit; that of TWIN2.toml when absent.")
    ] = None,
    level: Annotated[float, typer.Option(help="Coverage of the intervals.", min=0.5, max=0.999)] = 0.9,
    method: Annotated[
        str, typer.Option(help="whittle: mode and noises jointly; eq8: spectral peak and logarithmic decrement.")
    ] = "whittle",
    optimiser: Annotated[
        str | None,
        typer.Option(help="Contact twin: zoa, zoa-ports (R = 0.01), differential-evolution (default), random."),
    ] = None,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Identify the twin's free parameters from records, with intervals and figures of the fit."""
    from dataclasses import replace

    from twingap.errors import TwingapError
    from twingap.files import replacing
    from twingap.identification import identify as run
    from twingap.identification.figures import write_figure
    from twingap.records.folder import read_record_set
    from twingap.twins.twin_file import read_twin, write_twin

    spec = read_twin(twin)
    figure = (out.parent if figures is None else figures) / f"{out.stem}_fit.png"
    for path in (out, figure):
        refuse_overwriting(path, twin, recordset)
    records = read_record_set(recordset)
    # Both files are created at first, and filled only after success.
    with replacing(out) as text, replacing(figure) as drawing:
        with progress("reading") as shown:
            found = run(
                records,
                spec,
                seed=seed,
                level=level,
                method=method,
                optimiser=optimiser,
                progress=shown.share,
            )
        try:
            # With the geometry of the identification, since a table of conditions has none for simulations.
            write_twin(text, replace(found.spec, bearing=records.bearing or found.spec.bearing))
        except TwingapError as error:  # it names the temporary file
            raise TwingapError(error.what, where=out, mend=error.mend) from error
        try:
            write_figure(drawing, found.fits)
        except TwingapError as error:
            raise TwingapError(error.what, where=figure, mend=error.mend) from error
    if as_json:
        about = {
            "parameters": {
                name: {"value": e.value, "ci": None if e.interval is None else list(e.interval), "level": level}
                for name, e in found.estimates.items()
            },
            "notes": list(found.notes),
            "twin": str(out),
            "figures": [str(figure)],
        }
        say_json(about)
    else:
        rows = [
            {
                "parameter": n,
                "value": f"{e.value:.4g}",
                f"{level:.0%} interval": e.interval and "{:.4g} to {:.4g}".format(*e.interval),
            }
            for n, e in found.estimates.items()
        ]
        show(rows, False, title=f"{spec.model} twin from {len(records)} records")
        for note in found.notes:
            say(f"note: {note}")
    wrote(out, figure, as_json=as_json)
