"""study.md: a finished study as Markdown tables."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twingap import files
from twingap.study.scores import COMPARED


def markdown(table: Mapping[str, Any]) -> str:
    """A study as Markdown."""
    about = table["provenance"]
    frozen = "the code of the diagnosis did not change between sealing and opening" if about["frozen"] else (
        "**the code of the diagnosis changed after the worlds were sealed**")  # fmt: skip
    parts = [
        "# Blind study of the gap diagnosis",
        f"{about['cases']} worlds, seed {about['seed']}; {frozen}. Command: `{about['command']}`. Rates with exact "
        "(Clopper-Pearson) 95 % intervals; medians by order statistics; precision and recall over effects of all "
        "worlds together, counted as if independent.",
        "## Scores against targets", _scores(table["scores"]),
        "## Rivals on the same worlds", _rivals(table),
        *(f"Not run: {name} ({why})." for name, why in about["rivals_skipped"].items()),
        "## Statuses by kind of world", grid(table["statuses"]),
        "## By effect", _by_effect(table["by_effect"]),
        "## Outside the catalogue", grid([
            {"effect": r["effect"], "recognised": _rate(r), "named instead": _tally(r)}
            for r in table["by_uncatalogued"]
        ]),
        "## Parameters", grid([
            {"effect": r["effect"], "parameter": r["parameter"], "n": r["n"],
             "median relative error": f"{r['median_relative_error']:.3g}",
             "90 % interval covers": "" if r["ci_covers"] is None else f"{r['ci_covers']:.2f} of {r['with_ci']}"}
            for r in table["parameters"]
        ]),
        "## Reliability of probabilities", grid([
            {"predicted": f"{r['mean_probability']:.2f}",
             "observed": f"{r['value']:.2f} ({r['low']:.2f} to {r['high']:.2f})", "n": r["n"]}
            for r in table["reliability"]
        ]),
        "## Details", _scores(table["details"]),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _scores(rows: Sequence[Mapping[str, Any]]) -> str:
    return grid([
        {"score": r["score"], "among": r["among"], "value": _number(r["value"]),
         "95 % interval": _interval(r), "n": r["n"], "target": r["target"] or "",
         "met": {None: "", True: "yes", False: "**no**"}[r["met"]]}
        for r in rows
    ])  # fmt: skip


def _rivals(table: Mapping[str, Any]) -> str:
    chosen = [(r["score"], r["among"]) for r in table["scores"] if r["score"] in COMPARED]
    methods = {"diagnosis": table["scores"], **table["rivals"]}
    rows = []
    for method, scores in methods.items():
        by = {(s["score"], s["among"]): s for s in scores}
        rows.append({"method": method, **{f"{name}: {among}": _rate(by[name, among]) for name, among in chosen}})
    return grid(rows)


def _by_effect(rows: Sequence[Mapping[str, Any]]) -> str:
    columns = ("detected", "first-named right", "exact set", "found in company")
    keys = dict.fromkeys((r["effect"], r["strength"]) for r in rows)
    by = {(r["effect"], r["strength"], r["score"]): r for r in rows}
    return grid([
        {"effect": e, "strength": s,
         **{c: "" if (e, s, c) not in by else f"{by[e, s, c]['k']}/{by[e, s, c]['n']}" for c in columns}}
        for e, s in keys
    ])  # fmt: skip


def grid(rows: Sequence[Mapping[str, Any]]) -> str:
    """A Markdown table."""
    if not rows:
        return "(no rows)"
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(row[name]) for name in head) + " |" for row in rows]
    return "\n".join(lines)


def _rate(row: Mapping[str, Any]) -> str:
    if row["value"] is None:
        return "-"
    return f"{row['value']:.2f} ({row['low']:.2f} to {row['high']:.2f}, n {row['n']})"


def _tally(row: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {count}" for name, count in row["effects named instead"].items())


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _interval(row: Mapping[str, Any]) -> str:
    if row["low"] is None and row["high"] is None:
        return ""
    return f"{_number(row['low'])} to {_number(row['high'])}"


def write_tables(table: Mapping[str, Any], text: str, folder: Path, name: str) -> list[Path]:
    """Write a table as NAME.json and its text as NAME.md; returns their paths."""
    data = json.dumps(finite(table), indent=1, allow_nan=False) + "\n"
    written = [folder / f"{name}.json", folder / f"{name}.md"]
    for path, content in zip(written, (data, text), strict=True):
        with files.replacing(path) as temporary:
            temporary.write_text(content, encoding="utf-8")
    return written


def finite(value: Any) -> Any:
    """NaN and infinities as null; tuples as lists; NumPy numbers as numbers."""
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
