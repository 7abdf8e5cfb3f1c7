"""Population twin: machines drawn from the spread of a twin's values over units (bearings, mountings).

values by unit of each fault --mean, deviations--> mean + random mix of deviations --> values of a machine of its own

The deviations of all values of a unit are mixed with the same random weights, so that what belongs together stays
together, such as a stiff path and its quiet background. With normal weights over the root of the number of units less
one, drawn values have the units' mean and covariance.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Effect, make_effect
from twingap.effects.base import within_allowed
from twingap.effects.by_state import UNIT_COLUMNS, ByState, State, by_state
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]

MACHINE: Final = "unit"
"""Column of records.csv that names the machine."""
_PLACES: Final = ("Hz", "shaft orders")
"""Units of lists that say where something lies, whose items are not the same in different units."""


def has_population(spec: TwinSpec) -> bool:
    """Whether a fault has values of several units, from whose spread machines can be drawn."""
    effects = (make_effect(name, spec.parameters.get(name), "twin") for name in spec.effects)
    return _has_several(_units_of(effects))


def machines(spec: TwinSpec, count: int, rng: np.random.Generator) -> Iterator[tuple[str, TwinSpec]]:
    """Names and twins of machines drawn from a population.

    Parameters
    ----------
    spec : TwinSpec
        Twin with values by unit, such as ``closest.toml`` of records of several bearings.
    count : int
        Number of machines.
    rng : numpy.random.Generator

    Raises
    ------
    TwingapError
        For a twin whose values are the same for all units.
    """
    effects = {name: make_effect(name, spec.parameters.get(name), "twin") for name in spec.effects}
    faults = _units_of(effects.values())
    if count < 1:
        raise TwingapError(f"{count} machines asked for, at least 1 expected", where="population")
    if not _has_several(faults):
        raise TwingapError(
            "has no values of several units, so that no population can be drawn",
            where="twin", mend="take closest.toml of a diagnosis whose records.csv has a column bearing_id",
        )  # fmt: skip
    digits = len(str(count))
    for number in range(count):
        weights = {fault: _weights(len(units), rng) for fault, units in faults.items()}
        drawn = {name: _drawn(effect, faults, weights) for name, effect in effects.items()}
        own = {name: effect.parameter_values() for name, effect in drawn.items() if isinstance(effects[name], ByState)}
        name = f"machine{number + 1:0{digits}d}"
        yield name, dataclasses.replace(spec, parameters={**spec.parameters, **own})


def conditions_of(conditions: Sequence[Condition], machine: str) -> list[Condition]:
    """Conditions of a machine's records, named after it."""
    return [
        dataclasses.replace(
            c, name=f"{machine}_{c.name}", group=f"{machine}_{c.group or c.name}",
            extra={**{k: v for k, v in c.extra.items() if k not in UNIT_COLUMNS}, MACHINE: machine},
        )
        for c in conditions
    ]  # fmt: skip


def _units_of(effects: Iterable[Effect]) -> dict[str, list[str]]:
    """Fault -> units with values of their own in any effect."""
    out: dict[str, list[str]] = {}
    for effect in effects:
        for state, _ in effect.states if isinstance(effect, ByState) else ():
            if state.unit and state.unit not in out.setdefault(state.fault, []):
                out[state.fault].append(state.unit)
    return out


def _has_several(faults: Mapping[str, Sequence[str]]) -> bool:
    """Whether a fault has several units."""
    return any(len(units) > 1 for units in faults.values())


def _weights(count: int, rng: np.random.Generator) -> Array:
    """[units] Weights of the deviations of the units."""
    return rng.standard_normal(count) / math.sqrt(max(count - 1, 1))


def _drawn(effect: Effect, faults: Mapping[str, Sequence[str]], weights: Mapping[str, Array]) -> Effect:
    """The effect of a drawn machine: values by fault, and none by unit."""
    if not isinstance(effect, ByState):
        return effect
    states = {state: own for state, own in effect.states if not state.unit}
    for fault, units in faults.items():
        own = [effect.of(State(fault, unit)) for unit in units]
        states[State(fault)] = _mixed(own, weights[fault]) if len(own) > 1 else own[0]
    return by_state(effect.base, states)


def _mixed(own: Sequence[Effect], weights: Array) -> Effect:
    """The effect at the mean of the units' values and a mix of their deviations.

    Where units differ in frequencies or orders, such as those of lines, the values are those of a single unit.
    """
    nearest = own[int(np.argmax(weights))]
    if any(len({getattr(e, f.name) for e in own}) > 1 for f in nearest.profiles() if f.metadata["unit"] in _PLACES):
        return nearest
    values: dict[str, Any] = {}
    for field in (*nearest.parameters(), *nearest.profiles()):
        of_units = [getattr(effect, field.name) for effect in own]
        if len(set(of_units)) == 1:
            continue
        rows = np.asarray(of_units, float)
        logarithmic = bool(field.metadata.get("log")) and bool(np.all(rows > 0))
        rows = np.log(rows) if logarithmic else rows
        mixed = rows.mean(axis=0) + weights @ (rows - rows.mean(axis=0))
        mixed = np.exp(mixed) if logarithmic else mixed
        if "profile" in field.metadata:
            low, high = field.metadata["allowed"]
            values[field.name] = tuple(float(v) for v in np.clip(mixed, low, high))
        else:
            values[field.name] = within_allowed(field, float(mixed))
    return dataclasses.replace(cast(Any, nearest), **values)  # type: ignore[no-any-return]
