"""Effects that are measured from spectra, named where held-out records are closer to the twin with them.

verdict's twin --path, lines, background measured one after the other--> closer to held-out records? --> Explanation
a path that whole waveforms pass --> effects that stand in for it leave

No detector is trained for them, since they hold lists. A spectrum can always be matched: one is named only where it
closes a part of the gap that the error of calibrated values does not reach.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from twingap.effects.registry import look_alikes, measured_from_spectra
from twingap.effects.transfer_path import passed_by_all_samples
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.paired import Paired
from twingap.gap.search import unlearnt
from twingap.gap.search.effect_search import ALPHA_REST, Estimated, Explanation
from twingap.gap.search.evidence import Compared, Evidence, replicates_of
from twingap.gap.search.free_spectra import (
    PATH,
    Chain,
    by_fault_or_all,
    measured,
)
from twingap.gap.search.optimise import validation_distance
from twingap.gap.search.sign_flips import p_of_gain
from twingap.twins.simulator import Simulator

LEVEL: Final = 0.01
"""Level of the test for each. A larger value names more of them."""
LEAST: Final = 0.15
"""Part of the fit part's distance that one has to close. A smaller value names some that make up for errors of other
values."""
_LEFT: Final = 0.25
"""Part of the fit part's distance that effects with detectors have to leave. A smaller value asks more often, which
takes time, and names some that make up for errors of other values."""
_CLEAR: Final = 2.0
"""Distance, over its floor, from which a part of it can be told. A smaller value names some that fit chance."""
_REPLICATES: Final = 3
"""Simulations of every held-out record that a test averages. A larger number gives the test more power."""


def with_measured(evidence: Evidence, found: Explanation) -> Explanation:
    """The explanation with those effects that are measured from spectra and named.

    Parameters
    ----------
    evidence : Evidence
    found : Explanation
        Of effects with detectors.
    """
    # In the order of the catalogue: what the path explains is no background.
    names = [name for name in measured_from_spectra() if evidence.can_add(name) is None]
    if not found.gap or not names or (found.effects and found.rest_p > ALPHA_REST):
        return found
    bare = validation_distance(evidence, found.before.simulator, ())
    left = validation_distance(evidence, found.after.simulator, found.after.effects)
    if left < _LEFT * bare:
        return found
    real, conditions = evidence.held_out.vectors, evidence.held_out.conditions
    grid = Grid.of(conditions, evidence.frame.bearing)

    def made(compared: Compared) -> list[FeatureVectors]:
        count = replicates_of(compared.simulator, conditions, _REPLICATES)
        return [
            evidence.vectors(evidence.simulated(compared.simulator, compared.effects, conditions, 2 + k), grid)
            for k in range(count)
        ]

    before = Paired(real, made(found.before))
    whole = float(before.over_domains(before.squares())[0][0])
    if whole < _CLEAR * before.floor(np.random.default_rng(evidence.root))[0]:
        return found
    now, here = found.after, before if found.after.effects == () else Paired(real, made(found.after), before.scale)
    tested: dict[str, float] = {}
    for name in names:
        # Asked of the fit part: names must not be chosen by the closure that is reported.
        ways = [(validation_distance(evidence, *one), one) for one in _measured(evidence, now, name)]
        if not ways:
            continue
        nearer, one = min(ways, key=lambda way: way[0])
        if left - nearer < LEAST * bare:
            continue
        nearer, one = _without_surrogates(evidence, nearer, one, LEAST * bare)
        compared = Compared(evidence, one[1], one[0])
        there = Paired(real, made(compared), before.scale)
        if (p := p_of_gain(here, there, evidence.root)) <= LEVEL:
            now, here, left = compared, there, nearer
            tested[name] = p
    if not tested:
        return found
    chain = {effect.name: effect for effect in now.effects}
    gone = {effect.name for effect in found.after.effects} - chain.keys()
    probability = {name: unlearnt.probability(p) for name, p in tested.items()}
    sets = ((*(n for n in names_of if n not in gone), *tested) for names_of in found.confidence_set)
    return replace(
        found, effects=(*(one for one in found.effects if one.effect.name not in gone),
                        *(Estimated(chain[name], {}) for name in tested)),
        after=now, probability={**found.probability, **dict.fromkeys(gone, 0.0), **probability},
        confidence_set=tuple(dict.fromkeys(sets)),
    )  # fmt: skip


def _measured(evidence: Evidence, now: Compared, name: str) -> list[tuple[Simulator, Chain]]:
    """The twin with an effect as measured: with a path of impacts and, for finished waveforms, one of all samples."""
    own = evidence.against().simulator.makes_waveforms and name == PATH
    ways = [measured(evidence, now.simulator, now.effects, (name,), by=by_fault_or_all(evidence))]
    ways += [measured(evidence, now.simulator, now.effects, (name,), all_samples=True)] if own else []
    return [one for one in ways if one is not None]


def _without_surrogates(
    evidence: Evidence, distance: float, twin: tuple[Simulator, Chain], least: float
) -> tuple[float, tuple[Simulator, Chain]]:
    """The twin without effects that stand in for its path, where that filters whole waveforms, and its distance.

    One that closes `least` beside the path stays.
    """
    path = next((effect for effect in twin[1] if effect.name == PATH), None)
    if path is None or not passed_by_all_samples(path):
        return distance, twin
    for effect in twin[1]:
        if effect.name not in look_alikes(PATH):
            continue
        rest = tuple(other for other in twin[1] if other.name != effect.name)
        again = measured(evidence, twin[0], rest, (PATH,))
        if again is not None and (other := validation_distance(evidence, *again)) < distance + least:
            distance, twin = other, again
    return distance, twin
