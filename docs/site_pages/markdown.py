"""Markdown: tables and text that is safe inside them."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A Markdown table of rows with the same keys; "" for no rows."""
    if not rows:
        return ""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(cell(row[name]) for name in head) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def cell(value: Any) -> str:
    """Text of a table's cell: one line, without the character that separates cells."""
    return " ".join(str(value).split()).replace("|", "\\|")


def number(value: float) -> str:
    """A number as short as it is exact."""
    return f"{value:g}"


def described(thing: object) -> str:
    """The docstring of a class or function as Markdown, its numpy sections left out."""
    text = inspect.getdoc(thing) or ""
    paragraphs = text.split("\n\n")
    kept = []
    for paragraph in paragraphs:
        lines = paragraph.splitlines()
        if len(lines) > 1 and lines[1].strip() and set(lines[1].strip()) == {"-"}:
            break
        kept.append(safe(paragraph))
    return "\n\n".join(kept)


def safe(text: str) -> str:
    """Text without characters that Markdown or HTML would take for markup; code in back quotes stays as it is."""
    parts = text.replace("``", "`").split("`")
    for i in range(0, len(parts), 2):
        for mark in "*_<[":
            parts[i] = parts[i].replace(mark, "\\" + mark)
    return "`".join(parts)
