"""An effect whose values differ between faults and units: another bearing, mounting and path for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from twingap.effects.base import Effect, Stage
from twingap.effects.draft import Draft
from twingap.records import Condition

UNITS: Final = "units"
"""Table of a fault's units in a twin file."""
UNIT_COLUMNS: Final = ("bearing_id", "bearing", "unit")
"""Columns of records.csv that name the unit (bearing, mounting, machine); the first that a record has counts."""


class State(NamedTuple):
    """Records that share values of an effect: those with a fault, or those of one unit with that fault.

    Parameters
    ----------
    fault : str
        "" for all records.
    unit : str
        "" for all units.
    """

    fault: str
    unit: str = ""


def unit_of(condition: Condition) -> str:
    """Unit of a record; "" where its record set names none."""
    return next((str(value) for name in UNIT_COLUMNS if (value := condition.extra.get(name))), "")


@dataclass(frozen=True)
class ByState(Effect):
    """An effect with values of its own for records of some faults or units.

    Machines of one record set with different faults are often different bearings, mounted anew. In a twin file, a table
    named by the fault within the effect's table states their values, and tables of its units those of single bearings::

        [parameters.slip_jitter]
        sigma = 0.01
        [parameters.slip_jitter.outer]
        sigma = 0.03
        [parameters.slip_jitter.outer.units.OR021]
        sigma = 0.04

    Parameters
    ----------
    base : Effect
        For all other records.
    states : tuple of (State, Effect)
        State -> the effect at its values.
    """

    base: Effect
    states: tuple[tuple[State, Effect], ...] = ()

    @property
    def stage(self) -> Stage:  # type: ignore[override]
        return self.base.stage

    @property
    def group(self) -> str:  # type: ignore[override]
        return self.base.group

    @property
    def by_chance(self) -> bool:  # type: ignore[override]
        return self.base.by_chance

    @property
    def measured(self) -> bool:  # type: ignore[override]
        return self.base.measured

    @property
    def name(self) -> str:
        return self.base.name

    @property
    def own_noise(self) -> float:
        return self.base.own_noise

    @property
    def has_units(self) -> bool:
        """Whether single units have values of their own."""
        return any(state.unit for state, _ in self.states)

    def of(self, state: State) -> Effect:
        """The effect of records of a state: that of the unit, else of the fault, else the base."""
        known = dict(self.states)
        return known.get(state) or known.get(State(state.fault)) or self.base

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        self.of(_state_of(draft.condition)).apply(draft, rng)

    def cannot_act_on(self, draft: Draft) -> str | None:
        return self.of(_state_of(draft.condition)).cannot_act_on(draft)

    def parameter_values(self) -> dict[str, Any]:
        """Values of the base, a table for each fault with other ones, and within it one for each such unit."""
        out = self.base.parameter_values()
        for state, effect in self.states:
            above = self.base if not state.unit else self.of(State(state.fault))
            known = above.parameter_values()
            different = {name: value for name, value in effect.parameter_values().items() if value != known[name]}
            if different and state.unit:
                out.setdefault(state.fault, {}).setdefault(UNITS, {})[state.unit] = different
            elif different:
                out.setdefault(state.fault, {}).update(different)
        return out


def by_state(base: Effect, states: Mapping[State, Effect]) -> Effect:
    """The effect with other values for some states; the base itself where none differ."""
    made = ByState(base, tuple(states.items()))
    kept = tuple(
        (state, effect)
        for state, effect in made.states
        if effect != (made.of(State(state.fault)) if state.unit else base)
    )
    return ByState(base, kept) if kept else base


def of_state(effect: Effect, state: State) -> Effect:
    """The effect at the values of records of a state."""
    return effect.of(state) if isinstance(effect, ByState) else effect


def _state_of(condition: Condition) -> State:
    return State(str(condition.fault), unit_of(condition))
