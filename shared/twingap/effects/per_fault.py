"""An effect whose values differ between faults: another bearing, mounting and path for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from twingap.effects.base import Effect, Stage
from twingap.effects.draft import Draft


@dataclass(frozen=True)
class PerFault(Effect):
    """An effect with values of its own for records of some faults.

    Machines of one record set with different faults are often different bearings, mounted anew. In a twin file, a table
    named by the fault within the effect's table states them::

        [parameters.slip_jitter]
        sigma = 0.01
        [parameters.slip_jitter.outer]
        sigma = 0.03

    Parameters
    ----------
    base : Effect
        For all other records.
    faults : tuple of (str, Effect)
        Fault -> the effect at that fault's values.
    """

    base: Effect
    faults: tuple[tuple[str, Effect], ...] = ()

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
    def name(self) -> str:
        return self.base.name

    @property
    def own_noise(self) -> float:
        return self.base.own_noise

    def of(self, fault: str | None) -> Effect:
        """The effect of records with this fault."""
        return dict(self.faults).get(str(fault), self.base)

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        self.of(draft.condition.fault).apply(draft, rng)

    def cannot_act_on(self, draft: Draft) -> str | None:
        return self.of(draft.condition.fault).cannot_act_on(draft)

    def parameter_values(self) -> dict[str, Any]:
        """Values of the base, and a table for each fault with other ones."""
        out = self.base.parameter_values()
        for fault, effect in self.faults:
            values = effect.parameter_values()
            if different := {name: value for name, value in values.items() if value != out[name]}:
                out[fault] = different
        return out


def per_fault(base: Effect, faults: Mapping[str, Effect]) -> Effect:
    """The effect with other values for some faults; the base itself where none differ."""
    different = tuple((fault, effect) for fault, effect in faults.items() if effect != base)
    return PerFault(base, different) if different else base


def of_fault(effect: Effect, fault: str | None) -> Effect:
    """The effect at the values of records with this fault."""
    return effect.of(fault) if isinstance(effect, PerFault) else effect
