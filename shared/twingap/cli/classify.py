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
        Path, typer.Argument(metavar="RECORDSET", help="Records of one sampling rate; a column fault is not used.")
    ],
    twin: Annotated[Path, typer.Option(metavar="TWIN.toml", help="Twin of the simulated machines.")],
    out: Annotated[Path, typer.Option(metavar="predictions.csv", help="File for the classes.")],
    method: Annotated[
        str,
        typer.Option(
            help=f"orders: trees on lines at the bearing's orders and on levels; or a method of paper 3: {_METHODS}."
        ),
    ] = "orders",
    machines: Annotated[
        int, typer.Option(help="Simulated machines per class to train a network on.", min=4, max=100_000)
    ] = 200,
    steps: Annotated[int, typer.Option(help="Gradient steps of a network.", min=1)] = 600,
    match: Annotated[
        bool,
        typer.Option(
            "--match/--no-match",
            help="Estimate true speeds from the records; for a network, free parameters too.",
        ),
    ] = True,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Classify the faults of unlabelled records by a classifier trained on simulated machines.

    Confidence is calibrated on simulated machines that were not used for training: of records with 80 % confidence,
    80 % are correct if the real machine is similar to those simulated. It does not account for what the twin lacks (see
    `twingap gap`).

    predictions.csv has the columns record, predicted, confidence and a probability per class (healthy, inner, outer,
    ball), one row per record.
    """
    from twingap.files import replacing
    from twingap.records.folder import read_record_set
    from twingap.records.table import write_table
    from twingap.twins.twin_file import read_twin

    refuse_overwriting(out, twin, recordset)
    spec = read_twin(twin)
    records = read_record_set(recordset, labelled=False)
    # The file is created at first, and filled only after success.
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
        f"confidence is valid for machines like those simulated: of {like.records} records not used for training, "
        f"{like.accuracy:.0%} were classified correctly at a mean confidence of {like.confidence:.0%}; it does not "
        "account for what the twin lacks, which `twingap gap` names"
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
