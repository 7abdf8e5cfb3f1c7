"""Validation of gap.json against the JSON Schema that ships with the package.

gap.json (parsed) --problems--> list of "path: error"; empty for a valid report

`gap_report.schema.json` states types, ranges and required keys. The functions below check what a schema cannot state:
finite numbers, intervals with lo <= hi, the order of shares and probabilities, effects without duplicates.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import resources
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError

_LONGEST = 160
"""Largest number of characters of a message; longer ones, which quote a table, are cut."""


@cache
def schema() -> Mapping[str, Any]:
    """The JSON Schema of gap.json."""
    text = resources.files("twingap.gap.report").joinpath("gap_report.schema.json").read_text(encoding="utf-8")
    return json.loads(text)  # type: ignore[no-any-return]


def version() -> str:
    """Value of the key ``schema`` of gap.json."""
    return str(schema()["properties"]["schema"]["const"])


def problems(table: Any) -> list[str]:
    """Errors of a gap report, parsed or before writing, each as "path: what"; an empty list for a valid one."""
    found = [_message(error) for error in _validator().iter_errors(table)]
    found += [f"{place}: not a finite number" for place in _not_finite(table, "")]
    return found or list(_inconsistent(table))


@cache
def _validator() -> Draft202012Validator:
    return Draft202012Validator(schema())


def _message(error: ValidationError) -> str:
    """An error as one line with its path."""
    place = ""
    for part in error.absolute_path:
        place += f"[{part}]" if isinstance(part, int) else f".{part}" if place else str(part)
    if error.validator == "required":
        missing = error.message.removesuffix(" is a required property").strip("'")
        return f"{place}.{missing}: missing" if place else f"{missing}: missing"
    # Quoted values may contain line breaks and tables.
    message = " ".join(error.message.split())
    if len(message) > _LONGEST:
        message = f"{error.validator} = {error.validator_value!r:.{_LONGEST}} is not kept"
    return f"{place}: {message}" if place else message


def _not_finite(value: Any, place: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _not_finite(item, f"{place}.{key}" if place else str(key))
    elif isinstance(value, (list, tuple)):
        for i, item in enumerate(value):
            yield from _not_finite(item, f"{place}[{i}]")
    elif isinstance(value, float) and not math.isfinite(value):
        yield place


def _inconsistent(table: Mapping[str, Any]) -> Iterator[str]:
    """Contradictions between values of a table that conforms to the schema."""
    verdict = table["verdict"]
    if len({frozenset(names) for names in verdict["confidence_set"]}) < len(verdict["confidence_set"]):
        yield "verdict.confidence_set: a set stands there twice"
    for key in ("where", "rest"):
        places = table.get(key, [])
        yield from _falling([place["share"] for place in places], f"{key}: shares")
        for i, place in enumerate(places):
            if place["lo"] is not None and place["hi"] is not None and place["lo"] > place["hi"]:
                yield f"{key}[{i}]: lo {place['lo']} is above hi {place['hi']}"
    names = [candidate["effect"] for candidate in table["which"]]
    yield from _falling([candidate["probability"] for candidate in table["which"]], "which: probabilities")
    yield from (f"which: {name!r} stands there twice" for name in dict.fromkeys(names) if names.count(name) > 1)
    yield from _falling([share["share"] for share in table["closest"]["attribution"]], "closest.attribution: shares")
    for key, part in table.items():
        if key not in ("curves", "provenance"):
            yield from _intervals(part, key)


def _intervals(value: Any, place: str) -> Iterator[str]:
    """Intervals, which keys with "ci" hold, whose ends are the wrong way round."""
    items: Iterable[tuple[str, Any]] = ()
    if isinstance(value, Mapping):
        items = ((f"{place}.{key}", item) for key, item in value.items())
        for key, item in value.items():
            if "ci" in key.split("_") and isinstance(item, list) and item[0] > item[1]:
                yield f"{place}.{key}: lo {item[0]} is above hi {item[1]}"
    elif isinstance(value, list):
        items = ((f"{place}[{i}]", item) for i, item in enumerate(value))
    for name, item in items:
        yield from _intervals(item, name)


def _falling(values: list[float], name: str) -> Iterator[str]:
    if values != sorted(values, reverse=True):
        yield f"{name} do not fall"
