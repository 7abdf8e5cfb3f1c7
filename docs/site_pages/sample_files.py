"""The page of the files of samples: what the readers state about each type."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path

from twingap.records import formats, samples

HEAD = """# Files of samples

A record set names files of these types: {suffixes}. Values are checked when they are read: a NaN, an infinity or a
missing sample ends the reading with file, row and column.
"""


def pages(docs: Path) -> dict[str, str]:
    """reference/sample-files.md."""
    head = HEAD.replace("{suffixes}", ", ".join(f"`{suffix}`" for suffix in samples.SUFFIXES))
    parts = [head, *_paragraphs((samples.__doc__ or "").strip().partition("\n\n")[2])]
    for title, text in _modules():
        parts += [f"## {title}\n", *_paragraphs(text)]
    return {"reference/sample-files.md": "\n".join(parts)}


def _modules() -> Iterator[tuple[str, str]]:
    """First line and the rest of each module of a format; of those whose first line names a suffix."""
    for found in pkgutil.iter_modules(getattr(formats, "__path__", ())):
        text = (importlib.import_module(f"{formats.__name__}.{found.name}").__doc__ or "").strip()
        first, _, rest = text.partition("\n\n")
        suffixes, colon, about = " ".join(first.split()).partition(": ")
        if any(suffix in suffixes for suffix in samples.SUFFIXES) and colon:
            yield suffixes.partition(" (")[0], f"{about[:1].upper()}{about[1:]}\n\n{rest}"


def _paragraphs(text: str) -> Iterator[str]:
    """Paragraphs but those of arrows, which are for who reads the code; those with columns as they are typed."""
    for paragraph in text.split("\n\n"):
        if "-->" in paragraph or not paragraph.strip():
            continue
        typed = any(line.startswith(" ") or "   " in line.strip() for line in paragraph.splitlines())
        yield f"```text\n{paragraph}\n```\n" if typed else paragraph + "\n"
