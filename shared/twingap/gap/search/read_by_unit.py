"""Values of the closest twin that the records of single units show exactly: a converter's step, the slip of a cage.

records of each unit of the fit part --`Effect.read_off_unit`--> values by unit, where these bring the twin closer
"""

from __future__ import annotations

from twingap.effects import Effect, catalogue, make_effect
from twingap.effects.base import HEALTHY_RMS
from twingap.effects.by_state import State, by_state, unit_of
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.free_spectra import Chain
from twingap.twins.simulator import Simulator


def read_by_unit(evidence: Evidence, simulator: Simulator, effects: Chain, name: str) -> Chain | None:
    """The effects with this one added, or in place of its given values, where units of the fit part show its values.

    Units whose records do not show them have the given values, or no such effect. None where no unit shows any.
    """
    fit = evidence.calibrated.fit
    places: dict[State, list[int]] = {}
    for place, condition in enumerate(fit.conditions):
        if condition.fault is not None:
            places.setdefault(State(condition.fault, unit_of(condition)), []).append(place)
    base = next((effect for effect in effects if effect.name == name), None) or _absent(make_effect(name))
    units = {field.name: field.metadata["unit"] for field in base.parameters()}
    own: dict[State, Effect] = {}
    for state, of_state in places.items():
        records = fit.take(of_state)
        found = catalogue()[name].read_off_unit(records, evidence.simulated(simulator, (), records.conditions, 0))
        scale = {n: simulator.reference_rms if units[n] == HEALTHY_RMS else 1.0 for n in found}
        if found:
            own[state] = base.moved(**{n: value / scale[n] for n, value in found.items()})
    return (*(effect for effect in effects if effect.name != name), by_state(base, own)) if own else None


def _absent(effect: Effect) -> Effect:
    """The effect at no strength, or at the smallest that is allowed."""
    strengths = [field.name for field in effect.parameters() if field.metadata["strength"]]
    return effect.moved(**dict.fromkeys(strengths, 0.0))
