"""The page of gap.json: every key, from the JSON Schema that the program validates with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from site_pages.markdown import safe, table
from twingap.gap.report.schema import schema, version

HEAD = """# gap.json

The result of `twingap gap` for programs. It is written beside `report.html` and validated against the JSON Schema that
ships with the package (`twingap/gap/report/gap_report.schema.json`). Its version is `{version}`.
`twingap.gap.read_report` reads it back.

Keys within a list have `[]` in their path, those of a table with free names have `*`.
"""


def pages(docs: Path) -> dict[str, str]:
    """reference/gap-json.md."""
    whole = schema()
    rows = [
        {"key": f"`{path}`", "type": _type(part), "always": "yes" if needed else "", "meaning": _about(part)}
        for path, part, needed in keys(whole, whole)
    ]
    return {"reference/gap-json.md": HEAD.replace("{version}", version()) + "\n" + table(rows)}


def keys(part: Mapping[str, Any], whole: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any, bool]]:
    """Every key below a part of the schema: its path, its part, whether it is required."""
    for name, child in part.get("properties", {}).items():
        child = _resolved(child, whole)
        place = f"{path}.{name}" if path else name
        yield place, child, name in part.get("required", ())
        yield from _inside(child, whole, place)


def _inside(child: Mapping[str, Any], whole: Mapping[str, Any], place: str) -> Iterator[tuple[str, Any, bool]]:
    yield from keys(child, whole, place)
    items = _resolved(child.get("items"), whole)
    if isinstance(items, Mapping):
        yield from _inside(items, whole, f"{place}[]")
    free = child.get("additionalProperties")
    if isinstance(free, Mapping):
        yield from _inside(_resolved(free, whole), whole, f"{place}.*")


def _resolved(part: Any, whole: Mapping[str, Any]) -> Any:
    """The part that a reference within the schema points to."""
    while isinstance(part, Mapping) and "$ref" in part:
        found: Any = whole
        for name in part["$ref"].removeprefix("#/").split("/"):
            found = found[name]
        part = {**found, **{key: value for key, value in part.items() if key != "$ref"}}
    return part


def _type(part: Mapping[str, Any]) -> str:
    if "const" in part:
        return f"`{part['const']}`"
    if "enum" in part:
        return ", ".join(f"`{choice}`" for choice in part["enum"])
    if "anyOf" in part:
        return " or ".join(dict.fromkeys(_type(choice) for choice in part["anyOf"]))
    kind = part.get("type", "")
    if kind == "array" and isinstance(part.get("items"), Mapping):
        inner = part["items"].get("type", "")
        return f"list of {inner}" if isinstance(inner, str) and inner else "list"
    words = kind if isinstance(kind, str) else " or ".join(kind)
    low, high = part.get("minimum"), part.get("maximum")
    if low is not None and high is not None:
        return f"{words}, {low:g} to {high:g}"
    return words


def _about(part: Mapping[str, Any]) -> str:
    return safe(str(part.get("description", "")))
