"""Section of public.md on the closest twin.

rows of `closest_row` --> tables: closure on unseen recordings, on unseen bearings, accuracy of taught classifiers
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from twingap.study.public_closest import PIECE_S, TAUGHT
from twingap.study.tables import grid

TEACHERS: Final = ("bare", "closest", "population", "real", "real and bare", "real and closest", "real and population")
"""What classifiers are taught by, in the order of the columns."""

Row = Mapping[str, Any]


def closest_section(rows: Sequence[Row]) -> list[str]:
    """Headings, texts and tables on the closest twin.

    Parameters
    ----------
    rows : sequence of mapping
        "closest" of public.json.
    """
    found = [row for row in rows if not row["refused"]]
    recordings = [row for row in found if not row["new_bearings"]]
    bearings = [row for row in found if row["new_bearings"]]
    taught = [row for row in found if "accuracy" in row]
    return [
        "## The closest twin",
        f"The bare phenomenological twin against records of {PIECE_S:g} s. The search for the closest twin sees the "
        "fitted records alone; everything below is measured on the judged ones. By bearing: closure of one bearing at "
        "a time, in which real records can take the twin's place: those of the same bearing at other operating "
        "points, and those of other bearings with the same fault. Population: machines drawn from the twin's values by "
        "bearing.",
        "### Unseen recordings of the same bearings",
        grid([_by_recording(row) for row in recordings]),
        "Effects of the closest twins:",
        "\n".join(
            f"- {row['title']}, {row['split_by']}, {_catalogue(row)}: {', '.join(row['effects']) or 'none'}"
            for row in recordings
        ),
        "### Unseen bearings",
        "One bearing of every fault is left out at a time; healthy records are fitted and not judged. All closures are "
        "by bearing.",
        grid([*(_by_bearing(row) for row in bearings), *_means(bearings)]),
        "### What a classifier learns from it",
        "Part of the judged recordings that extra-trees on the vectors of the distance name right. Simulated records "
        f"are those of the fitted conditions, {TAUGHT} times; real ones are the fitted ones. Real and simulated "
        "records have equal weight together. The closest twin has been fitted to labelled records, so that without "
        "real records too a classifier depends on their labels.",
        grid(_accuracies(taught)),
        *(f"Not found: {row['title']}, {row['split_by']} ({row['refused']})." for row in rows if row["refused"]),
    ]


def closure_rows(rows: Sequence[Row]) -> list[dict[str, str]]:
    """One row of text per split and catalogue: what the closest twin closes."""
    return [
        {
            "set": row["title"], "split": row["split_by"], "catalogue": _catalogue(row),
            "closest closes": row["refused"] or _with_interval(row["closure"]["closest"]),
        }
        for row in rows
    ]  # fmt: skip


def _catalogue(row: Row) -> str:
    return "effects with detectors" if row["detectors_alone"] else "all effects"


def _by_recording(row: Row) -> dict[str, str]:
    closure, by = row["closure"], row["by_bearing"]
    return {
        "set": row["title"], "split": row["split_by"], "catalogue": _catalogue(row),
        "records": f"{row['fitted']} fitted, {row['judged']} judged",
        "gap": f"{row['gap']['before']:.2f} (floor {row['gap']['floor']:.2f})",
        "named": ", ".join(row["named"]) or "nothing", "verdict closes": _with_interval(closure["verdict"]),
        "closest closes": _with_interval(closure["closest"]), "values by": row["by"],
        "population": _with_interval(closure.get("population")),
        "by bearing: closest": _number(by["closest"]),
        "same bearing, real": _number(by["same bearing"]), "other bearings, real": _number(by["other bearings"]),
    }  # fmt: skip


def _by_bearing(row: Row) -> dict[str, str]:
    by = row["by_bearing"]
    return {
        "set": row["title"], "split": row["split_by"],
        **{name: _number(by.get(name)) for name in ("verdict", "closest", "population")},
        "other bearings, real": _number(by["other bearings"]),
    }  # fmt: skip


def _means(rows: Sequence[Row]) -> list[dict[str, str]]:
    """Mean over the splits of each set, of what is known in all of them."""
    out = []
    for title in dict.fromkeys(row["title"] for row in rows):
        own = [row["by_bearing"] for row in rows if row["title"] == title]
        means = {name: _mean([by.get(name) for by in own]) for name in ("verdict", "closest", "population")}
        others = _mean([by["other bearings"] for by in own])
        out.append({"set": title, "split": f"mean of {len(own)}", **means, "other bearings, real": others})
    return out


def _mean(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.mean(known):.2f}" if len(known) == len(values) else ""


def _accuracies(rows: Sequence[Row]) -> list[dict[str, str]]:
    """One row per set and kind of split: recordings of all its splits together."""
    out = []
    for title, new in dict.fromkeys((row["title"], row["new_bearings"]) for row in rows):
        own = [row for row in rows if (row["title"], row["new_bearings"]) == (title, new)]
        counts = [row["recordings"] for row in own]
        cells = {}
        for name in TEACHERS:
            known = [row["accuracy"].get(name) for row in own]
            cells[name] = "" if None in known else f"{np.average(known, weights=counts):.2f}"
        out.append({"set": title, "judged": f"{'new' if new else 'same'} bearings, {sum(counts)} recordings", **cells})
    return out


def _with_interval(value: Sequence[float] | None) -> str:
    return "" if value is None else f"{value[0]:.2f} ({value[1]:.2f} to {value[2]:.2f})"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
