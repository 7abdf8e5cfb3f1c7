"""`twingap bearings`: bearings that are known by name, and their orders."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from twingap.bearing import BEARINGS, Bearing
from twingap.cli.options import AnySeed, Effects, Json, say, show
from twingap.errors import TwingapError, one_of


def bearings(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="One bearing; all of them when left out.")] = None,
    effects: Effects = None,
    seed: AnySeed = 0,
    as_json: Json = False,
) -> None:
    """Bearings with their geometry and orders, in multiples of shaft speed."""
    if name is not None and name not in BEARINGS:
        raise TwingapError(
            f"unknown bearing {name!r}",
            mend=f"{one_of(name, BEARINGS, 'bearings')}; others need a [bearing] table in recordset.toml",
        )
    rows = [_row(each) for known, each in BEARINGS.items() if name in (None, known)]
    show(rows, as_json)
    if not as_json:
        say("orders: FTF cage, BPFO outer race, BPFI inner race, BSF rolling element; a ball defect strikes at 2 BSF")


def _row(bearing: Bearing) -> dict[str, Any]:
    return {
        "bearing": bearing.name, "rollers": bearing.n_rollers, "roller_diameter_mm": bearing.roller_diameter_mm,
        "pitch_diameter_mm": bearing.pitch_diameter_mm, "contact_angle_deg": bearing.contact_angle_deg,
        "ftf": bearing.ftf, "bpfo": bearing.bpfo, "bpfi": bearing.bpfi, "bsf": bearing.bsf,
    }  # fmt: skip
