"""Stand-ins for the tests of the study's machinery: no diagnosis, only something that answers.

In a module of its own, which worker processes can import.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from twingap.records import Record, RecordSet
from twingap.twins.twin_file import TwinSpec

EFFECTS = ("clipping", "quantisation")


def answer(status: str, effects: tuple[str, ...], p: float = 0.01) -> dict[str, Any]:
    """A gap report."""
    which = [
        {"effect": e, "probability": 0.9, "gap_before": 1.0, "gap_after": 0.2, "closure": 0.8, "closure_ci": [0.7, 0.9]}
        for e in effects
    ]
    metrics = [{"metric": "gap", "before": 1.0, "after": 0.2, "floor": 0.1, "ci_after": [0.1, 0.3]}]
    return {
        "schema": "twingap.gap/2",
        "verdict": {"status": status, "effects": list(effects), "confidence_set": [list(effects)], "p_value": p},
        "where": [], "which": which, "shrink": {"metrics": metrics}, "provenance": {},
    }  # fmt: skip


def by_level(
    records: RecordSet,
    twin: TwinSpec,
    *,
    seed: int | np.random.Generator = 0,
    sim: RecordSet | None = None,
    quick: bool = False,
) -> dict[str, Any]:
    """An answer that depends on the samples: many equal extremes are called clipping."""
    flat = np.mean([np.mean(np.abs(r.samples) > 0.999 * np.abs(r.samples).max()) for r in records])
    return answer("explained", ("clipping",)) if flat > 1e-3 else answer("no_gap", (), 0.5)


def closing(
    records: RecordSet,
    twin: TwinSpec,
    *,
    seed: int | np.random.Generator = 0,
    sim: RecordSet | None = None,
    quick: bool = False,
) -> dict[str, Any]:
    """Names nothing; the closest twin closes four fifths, where it is sought."""
    closest = {} if quick else {"closest": {"closure": 0.8}}
    return {**answer("unexplained", ()), **closest, "provenance": {"quick": quick}}


def interrupted(
    records: RecordSet,
    twin: TwinSpec,
    *,
    seed: int | np.random.Generator = 0,
    sim: RecordSet | None = None,
    quick: bool = False,
) -> dict[str, Any]:
    """Ends with an error where a simulator is brought."""
    if sim is not None:
        raise RuntimeError("the light went out")
    return by_level(records, twin, seed=seed)


def noisy_copy(
    records: RecordSet, spec: TwinSpec, rng: np.random.Generator, sim: RecordSet | None
) -> tuple[RecordSet, RecordSet]:
    """Stand-in for the calibrated twin: noise of the records' level. Short, since only the machinery is tested."""
    few = records.take(range(min(4, len(records))))
    made = [Record(r.condition, r.samples.std() * rng.standard_normal(r.samples.size)) for r in few]
    return few, RecordSet.from_records("simulated", "", records.bearing, made)


def tiny_worlds(n: int, rng: np.random.Generator) -> Iterator[tuple[RecordSet, RecordSet, frozenset[str]]]:
    """Noise with or without clipping and quantisation."""
    from twingap.bearing import BEARINGS
    from twingap.records import Condition

    for _ in range(n):
        effects = frozenset(e for e in EFFECTS if rng.random() < 0.4)
        sets = []
        for chosen in (effects, frozenset[str]()):
            rows = []
            for i in range(3):
                x = rng.standard_normal(1024)
                x = np.clip(x, -1.0, 1.0) if "clipping" in chosen else x
                x = np.round(x) if "quantisation" in chosen else x
                rows.append(Record(Condition(f"r{i}", 1500.0 + 100 * i, 8000.0, 1024, "outer"), x))
            sets.append(RecordSet.from_records("set", "", BEARINGS["6205"], rows))
        yield sets[0], sets[1], effects


def reachable(*roots: object) -> list[object]:
    """Everything that references lead to, but for code: modules, classes and the globals of functions."""
    seen: dict[int, object] = {}
    waiting = list(roots)
    while waiting:
        item = waiting.pop()
        if id(item) in seen or issubclass(type(item), (ModuleType, type)):
            continue
        seen[id(item)] = item
        if isinstance(item, FunctionType):
            waiting += [item.__closure__, item.__defaults__, item.__kwdefaults__, item.__dict__]
        else:
            waiting += gc.get_referents(item)
    return list(seen.values())


def suspicious(
    records: RecordSet,
    twin: TwinSpec,
    *,
    seed: int | np.random.Generator = 0,
    sim: RecordSet | None = None,
    quick: bool = False,
) -> dict[str, Any]:
    """Searches all that it was given for the truth and says what it found in place of effects."""
    from twingap.rigs.worlds import CATALOGUE, UNCATALOGUED, Case, Truth, World

    held = reachable(*(vars(r.condition) for r in records), vars(records), vars(twin), *([vars(sim)] if sim else []))
    found = {type(o).__name__ for o in held if isinstance(o, (Truth, World, Case))}
    words = {str(o) for o in held if isinstance(o, str)} & {*CATALOGUE, *UNCATALOGUED}
    found |= words - set(twin.effects)
    return answer("explained" if found else "no_gap", tuple(sorted(found)))
