"""Statistics of the impacts of single units: each has the values with which its own records are closest.

effects on impacts, a few strengths each --simulated, path and background of the units measured anew-->
    distance of each unit's records --> the best strength of each unit, where it is clearly better --> effects by unit

Defects of one kind differ from bearing to bearing: in their size, their place in the load zone, and how evenly they
strike. All units are simulated at a strength at once, since none of them depends on another.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from twingap.effects import Effect, Stage, catalogue, make_effect
from twingap.effects.by_state import ByState, State, by_state, unit_of
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.free_spectra import BACKGROUND, PATH, Chain, measured
from twingap.gap.search.sign_flips import squared_distances
from twingap.twins.simulator import Simulator

_STRENGTHS: Final = 4
"""Strengths of each effect that are tried. More fit closer and take longer."""
_WEAKEST: Final = 0.15
"""Smallest of them over the largest. A smaller value tries weaker effects, which hardly differ from none."""
_CLEARLY: Final = 0.95
"""Factor on a unit's squared distance that a strength has to reach. Closer to 1, chance decides more often."""
_GROUP: Final = "impact statistics"


def with_impacts_by_unit(
    evidence: Evidence, simulator: Simulator, effects: Sequence[Effect], names: Sequence[str]
) -> tuple[Simulator, Chain]:
    """The twin with effects on impacts at strengths of each unit's own, where they bring its records closer.

    The twin has path and background by unit. Effects of these `names` may be added, or get values by unit where the
    twin has them. It is as given where no unit's records are clearly closer.
    """
    chain = tuple(effects)
    spectra = [effect.name for effect in chain if effect.name in (PATH, BACKGROUND)]

    def both(tried: Chain, rounds: int = 1) -> Iterator[tuple[tuple[Simulator, Chain], dict[State, float]]]:
        """The twin with its spectra as they are, and measured anew, with the distance of each unit."""
        as_they_are = simulator, tried
        anew = measured(evidence, *as_they_are, spectra, rounds, by="unit")
        for made in (as_they_are, anew or as_they_are):
            yield made, _by_unit(evidence, *made)

    for name in names:
        given = next((effect for effect in chain if effect.name == name), None)
        rest = tuple(effect for effect in chain if effect.name != name)
        # What measuring the spectra anew gains is not what the effect does.
        least = _least(distances for _, distances in both(chain))
        nearest = {unit: _CLEARLY * distance for unit, distance in least.items()}
        best: dict[State, Effect] = {}
        for effect in _strengths(given or make_effect(name)):
            if not evidence.fits(effect):
                continue
            for unit, distance in _least(distances for _, distances in both((effect, *rest))).items():
                if distance < nearest[unit]:
                    nearest[unit], best[unit] = distance, effect
        if not best:
            continue
        base = given or make_effect(name).weakened(0.0)
        own = by_state(base, best)
        now, distances = min(both((own, *rest), 2), key=lambda made: sum(made[1].values()))
        if sum(distances.values()) < sum(least.values()):
            simulator, chain = now
    return simulator, chain


def unit_distance(evidence: Evidence, simulator: Simulator, effects: Sequence[Effect]) -> float:
    """Distance of single units' records from the twin: the root of its mean square over units, noise included."""
    return math.sqrt(np.mean(list(_by_unit(evidence, simulator, effects).values())))


def _least(found: Iterable[Mapping[State, float]]) -> dict[State, float]:
    """Unit -> the smallest of its distances."""
    rows = list(found)
    return {unit: min(row[unit] for row in rows) for unit in rows[0]}


def effects_on_impacts() -> list[str]:
    """Effects of the catalogue that change how impacts follow each other, and that can be absent at strength 0."""
    kinds = catalogue().items()
    return [n for n, kind in kinds if kind.stage is Stage.EXCITATION and kind.group == _GROUP and _may_be_absent(n)]


def _may_be_absent(name: str) -> bool:
    strengths = [field for field in make_effect(name).parameters() if field.metadata["strength"]]
    return len(strengths) == 1 and strengths[0].metadata["allowed"][0] <= 0


def _strengths(effect: Effect) -> Iterator[Effect]:
    """The effect in each of its forms at strengths up to the largest plausible one."""
    if isinstance(effect, ByState):
        return
    (field,) = (field for field in effect.parameters() if field.metadata["strength"])
    largest = field.metadata["plausible"][1]
    for form in effect.forms():
        for strength in np.geomspace(_WEAKEST, 1.0, _STRENGTHS) * largest:
            yield form.moved(**{field.name: float(strength)})


def _by_unit(evidence: Evidence, simulator: Simulator, effects: Sequence[Effect]) -> dict[State, float]:
    """Unit -> mean squared distance of its trial records; healthy records have no impacts."""
    pair = evidence.tried(simulator, effects)
    rows: dict[State, list[float]] = {}
    for condition, distance in zip(pair.conditions, squared_distances(pair), strict=True):
        if condition.fault != "healthy":
            rows.setdefault(State(str(condition.fault), unit_of(condition)), []).append(float(distance))
    return {unit: float(np.mean(own)) for unit, own in rows.items()}
