"""The page of the public data sets: what their manifests and readers state."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from site_pages.markdown import described, number, safe, table
from twingap.bearing import BEARINGS
from twingap.data import READERS, Manifest, manifest_names, manifest_of
from twingap.data.registry import reader

HEAD = """# Data sets

Public data sets that the program lists, fetches, verifies and exports as record sets. Their files lie below a data
root, one folder each: `--root`, or the environment variable `TWINGAP_DATA`.

```console
$ twingap data list
$ twingap data fetch cwru --root data
$ twingap data export cwru --root data --where load_hp=2 --out cwru-2hp
```
"""

FACTS = {
    "fault": "faults", "end_fault": "faults at the end", "speed_rpm": "speed, rpm",
    "nominal_speed_rpm": "nominal speed, rpm", "fs_hz": "sampling rate, Hz", "load_n": "load, N", "load_hp": "load, hp",
    "cantilever_load_kg": "cantilever load, kg", "fault_size_inch": "fault size, inch",
    "defect_arc_deg": "defect, deg of the raceway", "condition": "condition", "bearing_id": "bearings",
}  # fmt: skip
"""Field of a recording in a manifest -> what it is called on the page."""
MOST_VALUES = 8
"""Distinct values that are listed; of more, the range or the number is given."""


def pages(docs: Path) -> dict[str, str]:
    """reference/data-sets.md."""
    cards = [card(manifest_of(name)) for name in manifest_names()]
    return {"reference/data-sets.md": "\n".join((HEAD, *cards))}


def card(facts: Manifest) -> str:
    """The section of one data set."""
    rows = [{"": what, " ": value} for what, value in _stated(facts) if value]
    parts = [f"({facts.name}-card)=", f"## {facts.name}", "", safe(facts.title) + ".", "", safe(facts.description), ""]
    parts += [table(rows)]
    if facts.name in READERS:
        options = _options(facts.name)
        parts += [f'As a record set (`twingap.data.load("{facts.name}")`): {described(reader(facts.name))}', ""]
        parts += [f"Options of the reader: {options}.\n"] if options else []
    return "\n".join(parts)


def _stated(facts: Manifest) -> Iterable[tuple[str, str]]:
    yield "from", f"<{facts.url}>" if facts.url else "made here" if facts.made_here else ""
    yield "licence", safe(facts.licence)
    yield "cite", safe(facts.citation)
    yield "how to get", safe(facts.how_to_get or "")
    yield "size to fetch", _size(facts.size_bytes)
    yield "unit", facts.unit or "not stated by the owner"
    bearing = BEARINGS.get(facts.bearing or "")
    if bearing is not None:
        orders = f"BPFO {bearing.bpfo:.4f}, BPFI {bearing.bpfi:.4f}, BSF {bearing.bsf:.4f}, FTF {bearing.ftf:.4f}"
        yield "bearing", f"{bearing.name}, {bearing.n_rollers} rollers; orders {orders}"
    yield "recordings", str(len(facts.recordings) or "")
    for field, what in FACTS.items():
        yield what, _values(facts.recordings, field)
    stated = facts.card
    yield "channels", safe(stated.get("channels", ""))
    yield "loads", safe(stated.get("loads", ""))
    yield "labels", safe(stated.get("labels", ""))
    for trap in stated.get("traps", ()):
        yield "beware", safe(trap)
    yield "suits", ", ".join(f"`twingap {command}`" for command in stated.get("suits", ()))


def _values(recordings: Iterable[Mapping[str, Any]], field: str) -> str:
    """The values of a field over all recordings, in a cell."""
    values = [row[field] for row in recordings if field in row]
    distinct = list(dict.fromkeys(values))
    if not distinct:
        return ""
    if all(isinstance(value, (int, float)) for value in distinct):
        ordered = sorted(distinct)
        if len(ordered) > MOST_VALUES:
            return f"{number(ordered[0])} to {number(ordered[-1])}"
        return ", ".join(number(value) for value in ordered)
    if len(distinct) > MOST_VALUES:
        return f"{len(distinct)}"
    return safe(", ".join(f"{value} ({values.count(value)})" for value in distinct))


def _size(size_bytes: int | None) -> str:
    return "" if size_bytes is None else f"{size_bytes / 1e6:,.0f} MB".replace(",", " ")


def _options(name: str) -> str:
    parameters = inspect.signature(reader(name)).parameters
    return ", ".join(f"`{key}` (default `{one.default}`)" for key, one in parameters.items() if key != "root")
