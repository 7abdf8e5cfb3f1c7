"""The page of the public data sets: their data cards, as `twingap data list NAME` shows them."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from pathlib import Path

from site_pages.markdown import described, safe, table
from twingap.data import READERS, Manifest, card_of, manifest_names, manifest_of
from twingap.data.registry import reader

HEAD = """# Data sets

Public data sets that the program lists, fetches, verifies and exports as record sets. Their files lie below a data
root, one folder each: `--root`, or the environment variable `TWINGAP_DATA`.

```console
$ twingap data list
$ twingap data list cwru
$ twingap data fetch cwru --root data
$ twingap data export cwru --root data --where load_hp=2 --out cwru-2hp
```
"""


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
        parts += [f'As a record set (`twingap.data.load("{facts.name}")`): {described(reader(facts.name))}', ""]
        options = [
            f"`{key}` (default `{one.default}`)"
            for key, one in inspect.signature(reader(facts.name)).parameters.items()
            if key != "root"
        ]
        parts += [f"Options of the reader: {', '.join(options)}.\n"] if options else []
    return "\n".join(parts)


def _stated(facts: Manifest) -> Iterable[tuple[str, str]]:
    for what, value in card_of(facts).rows():
        yield what, safe(value)
    yield "from", f"<{facts.url}>" if facts.url else "made here" if facts.made_here else ""
    yield "how to get", safe(facts.how_to_get or "")
    yield "size to fetch", _size(facts.size_bytes)
    yield "licence", safe(facts.licence)
    yield "cite", safe(facts.citation)


def _size(size_bytes: int | None) -> str:
    return "" if size_bytes is None else f"{size_bytes / 1e6:,.0f} MB".replace(",", " ")
