"""Files of a fleet: fleet.json, fleet.csv and fleet.html; their bytes do not depend on run times."""

from __future__ import annotations

import json
import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

from twingap.files import replacing
from twingap.fleet.page import page
from twingap.fleet.summary import Fleet
from twingap.provenance import plain

SCHEMA: Final = "twingap.fleet/1"
NAMES: Final = ("fleet.json", "fleet.csv", "fleet.html")


def to_json(fleet: Fleet) -> dict[str, Any]:
    """Content of fleet.json."""
    machines = [
        {**plain(m), "report": f"{m.path}/report.html" if m.diagnosed else None, "gap": m.gap, "gap_after": m.gap_after}
        for m in fleet.machines
    ]
    return {
        "schema": SCHEMA,
        "statuses": fleet.statuses,
        "effects": plain(fleet.effects),
        "groups": [row._asdict() for row in fleet.groups],
        "machines": machines,
        "about": plain(fleet.about),
    }


def write_fleet(fleet: Fleet, out: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Write fleet.json, fleet.csv and fleet.html, all or none.

    Returns
    -------
    tuple of Path

    Raises
    ------
    TwingapError
        When the folder cannot be written.
    """
    texts = (
        json.dumps(to_json(fleet), indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        fleet.frame.to_csv(index=False, lineterminator="\n"),
        page(fleet),
    )
    paths = tuple(Path(out) / name for name in NAMES)
    with ExitStack() as places:
        for path, text in zip(paths, texts, strict=True):
            places.enter_context(replacing(path)).write_text(text, encoding="utf-8", newline="\n")
    return paths
