"""Files of a gap report: gap.json, which can be read back, and report.html.

GapReport --write_report--> DIR/gap.json, DIR/report.html
          <--read_report---

`schema` checks gap.json, `page` renders report.html.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twingap.errors import TwingapError
from twingap.files import open_text, replacing
from twingap.gap.report.model import GapReport, Place
from twingap.gap.report.page import page
from twingap.gap.report.schema import problems, version
from twingap.provenance import plain


def to_json(report: GapReport) -> dict[str, Any]:
    """The content of gap.json.

    Raises
    ------
    ValueError
        When the report violates the schema (`twingap.gap.report.schema`), with all errors: a number that is not
        finite, a probability beyond 1, effects with a status that has none.
    """
    table = {
        "schema": version(),
        "verdict": {**plain(report.verdict), "sentence": report.sentence},
        "where": [_place(p) for p in report.places],
        "which": [plain(c) for c in report.candidates],
        "shrink": {"metrics": [plain(m) for m in report.metrics]},
        "rest": [_place(p) for p in report.rest],
        "tests": plain(report.tests),
        "calibration": plain(report.calibration),
        "calibration_after": plain(report.calibration_after),
        "notes": list(report.notes),
        "provenance": plain(report.provenance),
        "curves": {name: _nulls(plain(curve)) for name, curve in report.curves.items()},
        "closest": plain(report.closest),
    }
    found = problems(table)
    if found:
        raise ValueError("the report violates its schema: " + "; ".join(found))
    return table


def write_report(report: GapReport, folder: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Write gap.json and report.html into a folder, both or none, and return their paths in this order.

    Raises
    ------
    TwingapError
        When the folder cannot be written.
    ValueError
        As `to_json`.
    """
    table = to_json(report)
    as_json, as_html = Path(folder) / "gap.json", Path(folder) / "report.html"
    with replacing(as_json) as data, replacing(as_html) as text:
        data.write_text(dumped(table), encoding="utf-8", newline="\n")
        text.write_text(page(report), encoding="utf-8", newline="\n")
    return as_json, as_html


def read_report(path: str | os.PathLike[str]) -> GapReport:
    """Read gap.json, or the folder that holds it, back.

    Raises
    ------
    TwingapError
        When there is none, or it is not a gap report.
    """
    place = Path(path)
    place = place / "gap.json" if place.is_dir() else place
    mend = "name a gap.json that `twingap gap` wrote"
    try:
        with open_text(place) as stream:
            table = json.loads(stream.read())
    except (ValueError, RecursionError) as error:
        raise TwingapError(f"is not JSON: {error}", where=place, mend=mend) from error
    if found := problems(table):
        raise TwingapError(f"is not a gap report: {found[0]}", where=place, mend=mend)
    try:
        return from_json(table)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise TwingapError(f"is not a gap report: {error!r}", where=place, mend=mend) from error


def from_json(table: Mapping[str, Any]) -> GapReport:
    """Report from the content of a gap.json that conforms to the schema; unknown keys are ignored."""
    named = {"places": table["where"], "candidates": table["which"], "metrics": table["shrink"]["metrics"]}
    return _read(GapReport, {**table, **named})  # type: ignore[no-any-return]


def dumped(table: Mapping[str, Any]) -> str:
    """Text of gap.json: indented, with lists of numbers on one line."""
    table = dict(table)
    curves = table.pop("curves", {})
    text = json.dumps(table, indent=2, ensure_ascii=False, allow_nan=False)
    if not curves:
        return text + "\n"
    # Curves hold thousands of numbers: one line per curve keeps the file readable.
    lines = ",\n".join(
        f"    {json.dumps(n, ensure_ascii=False)}: {json.dumps(c, ensure_ascii=False, allow_nan=False)}"
        for n, c in curves.items()
    )
    return f'{text[:-2]},\n  "curves": {{\n{lines}\n  }}\n}}\n'


def _place(place: Place) -> dict[str, Any]:
    """A place, without what does not apply: the condition when it is all, sign and change where there are none."""
    return {key: value for key, value in plain(place).items() if value is not None or key in ("lo", "hi")}


def _nulls(value: Any) -> Any:
    """NaN as null, and numbers rounded to six digits, more than a figure resolves."""
    if isinstance(value, dict):
        return {key: _nulls(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_nulls(item) for item in value]
    if isinstance(value, float):
        return None if math.isnan(value) else float(f"{value:.6g}")
    return value


def _read(kind: Any, value: Any) -> Any:
    """Parsed JSON as a value of this type: a dataclass, a tuple or a mapping of such, or what JSON itself has."""
    origin, of = typing.get_origin(kind), typing.get_args(kind)
    if value is None:
        return None
    if dataclasses.is_dataclass(kind):
        kinds = typing.get_type_hints(kind)
        known = [field.name for field in dataclasses.fields(kind) if field.name in value]
        return typing.cast(type, kind)(**{name: _read(kinds[name], value[name]) for name in known})
    if origin in (typing.Union, types.UnionType):
        return _read(of[0], value)
    if origin is tuple:
        each = of if of[-1] is not Ellipsis else of[:1] * len(value)
        return tuple(_read(one, item) for one, item in zip(each, value, strict=True))
    if origin is Mapping:
        return {name: _read(of[1], item) for name, item in value.items()}
    return value
