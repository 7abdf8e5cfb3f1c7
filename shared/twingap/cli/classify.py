"""`twingap classify`: fault classes of unlabelled records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twingap.cli.options import Effects, Json, Seed, refuse_overwriting, say, say_json, show, wrote
from twingap.cli.progress import progress

_METHODS = "VMD+SVM, Non-DA, MMD, DANN, DACD, Base-Attn, Non-DN, Base-NDN or Proposed"


def classify(
    recordset: Annotated[
        Path, typer.Argument(metavar="RECORDSET", help="Records of one sampling rate. A column fault is never read.")
    ],
    twin: Annotated[Path, typer.Option(metavar="TWIN.toml", help="What the simulated machines are drawn about.")],
    out: Annotated[Path, typer.Option(metavar="predictions.csv", help="Where the classes are written.")],
    method: Annotated[
        str,
        typer.Option(
            help=f"orders: trees on lines at the bearing's orders and on levels; or a method of paper 3: {_METHODS}."
        ),
    ] = "orders",
    machines: Annotated[int, typer.Option(help="Simulated machines per class to train a network on.", min=4)] = 200,
    steps: Annotated[int, typer.Option(help="Gradient steps, where a network is trained.", min=1)] = 600,
    match: Annotated[
        bool,
        typer.Option(
            "--match/--no-match",
            help="Correct speeds from the records first, and for a network fill the twin's free parameters.",
        ),
    ] = True,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Fault classes of unlabelled records, from a classifier trained on simulated machines.

    Confidence is calibrated on simulated machines that the classifier has not seen: of records stated at 80 %, 80 % are
    right as long as the real machine is like those simulated. What the twin lacks (see `twingap gap`) is not in it.

    predictions.csv has the columns record, predicted, confidence and a probability per class (healthy, inner, outer,
    ball), one row a record.
    """
    from twingap.files import replacing
    from twingap.records.folder import read_record_set
    from twingap.records.table import write_table
    from twingap.twins.twin_file import read_twin

    refuse_overwriting(out, twin, recordset)
    spec = read_twin(twin)
    records = read_record_set(recordset, labelled=False)
    # The place is tried before the work begins, and filled only after it has ended well.
    with replacing(out) as table:
        from twingap.adapt.classify import classify as run
        from twingap.adapt.classify_options import ClassifyOptions  # slow to import

        options = ClassifyOptions(method, machines, steps, match=match)
        with progress("reading") as shown:
            found = run(records, spec, options=options, seed=seed, progress=shown.share)
        rows = found.rows()
        write_table(table, rows, list(rows[0]))
    like = found.simulated
    meaning = (
        f"confidence holds for machines like those simulated: {like.records} of them, kept apart, were told right "
        f"{like.accuracy:.0%} of the time at a mean confidence of {like.confidence:.0%}; what the twin lacks, which "
        "`twingap gap` names, is not in it"
    )
    if as_json:
        about = {
            "out": str(out), "method": method, "seed": seed, "classes": list(found.classes), "records": rows,
            "simulated": {
                "records": like.records, "accuracy": like.accuracy, "confidence": like.confidence,
                "calibration_error": like.error, "temperature": found.temperature,
            },
            "window_samples": found.window_samples, "notes": [*found.notes, meaning],
        }  # fmt: skip
        say_json(about)
    else:
        show(rows, False, title=f"{len(rows)} {'record' if len(rows) == 1 else 'records'} by {method}")
        for note in (*found.notes, meaning):
            say(f"note: {note}")
    wrote(out, as_json=as_json)
