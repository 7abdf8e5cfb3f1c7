"""What a gap.json must hold, checked.

gap.json (parsed) --problems--> list of breaches, each naming its place; empty when the contract is kept

Beyond types and ranges it checks what the words of the contract promise: finite numbers, places by share, candidates
by probability and once each, intervals with lo <= hi, effects exactly where the status has some.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

SCHEMA: Final = "twingap.gap/1"
STATUSES: Final = ("no_gap", "explained", "partly_explained", "unexplained")
DOMAINS: Final = ("frequency", "envelope_order", "order", "amplitude", "time", "condition")


def problems(table: Any) -> list[str]:
    """Breaches of the contract, each as "place: what"; an empty list for a good report.

    Parameters
    ----------
    table : mapping
        Parsed gap.json, or what is about to be written as one.
    """
    if not isinstance(table, Mapping):
        return ["a table expected"]
    needed = ("schema", "verdict", "where", "which", "shrink", "provenance")
    missing = [f"{key}: missing" for key in needed if key not in table]
    if missing:
        return missing
    found = [] if table["schema"] == SCHEMA else [f"schema: {table['schema']!r} found, {SCHEMA!r} expected"]
    for check in (_verdict, _where, _which, _shrink, _provenance, _extras):
        found.extend(check(table))
    found.extend(f"{place}: not a finite number" for place in _not_finite(table, ""))
    return found


def _verdict(table: Mapping[str, Any]) -> Iterator[str]:
    verdict = table["verdict"]
    if not isinstance(verdict, Mapping):
        yield "verdict: a table expected"
        return
    yield from _has(verdict, "verdict", ("status", "effects", "confidence_set", "p_value"))
    status, effects, sets = verdict.get("status"), verdict.get("effects"), verdict.get("confidence_set")
    if status not in STATUSES:
        yield f"verdict.status: {status!r} found, one of {', '.join(STATUSES)} expected"
    if not _are_names(effects):
        yield "verdict.effects: a list of different names expected"
    elif status in ("no_gap", "unexplained") and effects:
        yield f"verdict.effects: {status} has none"
    elif status in ("explained", "partly_explained") and not effects:
        yield f"verdict.effects: {status} names at least one"
    if not isinstance(sets, list) or not all(map(_are_names, sets)):
        yield "verdict.confidence_set: a list of lists of names expected"
    elif len({frozenset(s) for s in sets}) < len(sets):
        yield "verdict.confidence_set: a set stands there twice"
    yield from _within_one(verdict.get("p_value"), "verdict.p_value")


def _where(table: Mapping[str, Any]) -> Iterator[str]:
    for key in ("where", "rest"):
        shares = []
        for name, place in _rows(table.get(key, []), key):
            if isinstance(place, str):
                yield place
                continue
            yield from _has(place, name, ("domain", "lo", "hi", "unit", "share", "p_value"))
            if place.get("domain") not in DOMAINS:
                yield f"{name}.domain: {place.get('domain')!r} found, one of {', '.join(DOMAINS)} expected"
            lo, hi = place.get("lo"), place.get("hi")
            if not all(v is None or _is_number(v) for v in (lo, hi)):
                yield f"{name}: lo and hi are numbers or null"
            elif lo is not None and hi is not None and lo > hi:
                yield f"{name}: lo {lo} is above hi {hi}"
            if not isinstance(place.get("unit"), str):
                yield f"{name}.unit: text expected"
            if "condition" in place and not isinstance(place["condition"], Mapping):
                yield f"{name}.condition: a table expected"
            yield from _within_one(place.get("share"), f"{name}.share")
            yield from _within_one(place.get("p_value"), f"{name}.p_value")
            shares.append(place.get("share"))
        yield from _falling(shares, f"{key}: shares")


def _which(table: Mapping[str, Any]) -> Iterator[str]:
    chances, names = [], []
    for name, candidate in _rows(table["which"], "which"):
        if isinstance(candidate, str):
            yield candidate
            continue
        numbers = ("gap_before", "gap_after", "closure")
        yield from _has(candidate, name, ("effect", "probability", *numbers, "closure_ci"))
        if not isinstance(candidate.get("effect"), str):
            yield f"{name}.effect: a name expected"
        yield from _within_one(candidate.get("probability"), f"{name}.probability")
        for key in numbers:
            if not _is_number(candidate.get(key)):
                yield f"{name}.{key}: a number expected"
        yield from _interval(candidate.get("closure_ci"), f"{name}.closure_ci")
        yield from _parameters(candidate.get("parameters", {}), f"{name}.parameters")
        chances.append(candidate.get("probability"))
        names.append(candidate.get("effect"))
    yield from _falling(chances, "which: probabilities")
    yield from (f"which: {name!r} stands there twice" for name in {n for n in names if names.count(n) > 1})


def _shrink(table: Mapping[str, Any]) -> Iterator[str]:
    shrink = table["shrink"]
    if not isinstance(shrink, Mapping) or "metrics" not in shrink:
        yield "shrink: a table with metrics expected"
        return
    yield from _metrics(shrink["metrics"], "shrink.metrics")


def _metrics(rows: Any, place: str) -> Iterator[str]:
    for name, metric in _rows(rows, place):
        if isinstance(metric, str):
            yield metric
            continue
        yield from _has(metric, name, ("metric", "before", "after", "floor", "ci_after"))
        if not isinstance(metric.get("metric"), str):
            yield f"{name}.metric: a name expected"
        for key in ("before", "after", "floor"):
            if not _is_number(metric.get(key)):
                yield f"{name}.{key}: a number expected"
        yield from _interval(metric.get("ci_after"), f"{name}.ci_after")
        if metric.get("ci_before") is not None:
            yield from _interval(metric["ci_before"], f"{name}.ci_before")


def _provenance(table: Mapping[str, Any]) -> Iterator[str]:
    if not isinstance(table["provenance"], Mapping):
        yield "provenance: a table expected"
        return
    yield from _has(table["provenance"], "provenance", ("seed", "version", "records_sha256", "runtime_s"))


def _extras(table: Mapping[str, Any]) -> Iterator[str]:
    """What this project writes beyond the contract's least."""
    yield from _parameters(table.get("calibration", {}), "calibration")
    for name, test in _rows(table.get("tests", []), "tests"):
        if isinstance(test, str):
            yield test
        else:
            yield from _has(test, name, ("name", "statistic", "p_value"))
            yield from _within_one(test.get("p_value"), f"{name}.p_value")
    if not isinstance(table.get("curves", {}), Mapping):
        yield "curves: a table expected"
    if "stand_ins" in table:
        yield from _stand_ins(table["stand_ins"], table["verdict"].get("effects"))


def _stand_ins(table: Any, named: Any) -> Iterator[str]:
    if not isinstance(table, Mapping):
        yield "stand_ins: a table expected"
        return
    yield from _has(table, "stand_ins", ("effects", "parameters", "closure", "closure_ci"))
    effects, parameters = table.get("effects"), table.get("parameters")
    if not _are_names(effects) or not effects:
        yield "stand_ins.effects: a list of different names expected"
    elif isinstance(named, list) and set(effects) & set(named):
        yield "stand_ins.effects: one of them is the verdict's"
    if not _is_number(table.get("closure")):
        yield "stand_ins.closure: a number expected"
    yield from _interval(table.get("closure_ci"), "stand_ins.closure_ci")
    yield from _metrics(table.get("metrics", []), "stand_ins.metrics")
    if not isinstance(parameters, Mapping):
        yield "stand_ins.parameters: a table expected"
        return
    for effect, values in parameters.items():
        yield from _parameters(values, f"stand_ins.parameters.{effect}")


def _parameters(table: Any, name: str) -> Iterator[str]:
    if not isinstance(table, Mapping):
        yield f"{name}: a table expected"
        return
    for key, value in table.items():
        if not isinstance(value, Mapping) or not _is_number(value.get("value")):
            yield f"{name}.{key}: a table with a number as value expected"
        elif not isinstance(value.get("unit"), str):
            yield f"{name}.{key}.unit: text expected"
        elif value.get("ci") is not None:
            yield from _interval(value["ci"], f"{name}.{key}.ci")


def _has(table: Mapping[str, Any], name: str, keys: tuple[str, ...]) -> Iterator[str]:
    yield from (f"{name}.{key}: missing" for key in keys if key not in table)


def _rows(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Name and table of each row; a text instead of the table says what is wrong."""
    if not isinstance(value, (list, tuple)):
        yield name, f"{name}: a list expected"
        return
    for i, row in enumerate(value):
        place = f"{name}[{i}]"
        yield place, row if isinstance(row, Mapping) else f"{place}: a table expected"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(v, str) for v in value) and len(set(value)) == len(value)


def _within_one(value: Any, name: str) -> Iterator[str]:
    if not _is_number(value) or not 0 <= value <= 1:
        yield f"{name}: {value!r} found, a number from 0 to 1 expected"


def _interval(value: Any, name: str) -> Iterator[str]:
    if not isinstance(value, (list, tuple)) or len(value) != 2 or not all(map(_is_number, value)):
        yield f"{name}: [lo, hi] expected"
    elif value[0] > value[1]:
        yield f"{name}: lo {value[0]} is above hi {value[1]}"


def _falling(values: list[Any], name: str) -> Iterator[str]:
    if all(map(_is_number, values)) and values != sorted(values, reverse=True):
        yield f"{name} do not fall"


def _not_finite(value: Any, place: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _not_finite(item, f"{place}.{key}" if place else str(key))
    elif isinstance(value, (list, tuple)):
        for i, item in enumerate(value):
            yield from _not_finite(item, f"{place}[{i}]")
    elif isinstance(value, float) and not math.isfinite(value):
        yield place
