"""Effects that are measured from spectra, named where held-out records are closer to the twin with them.

verdict's twin --path, lines, background measured one after the other--> closer to held-out records? --> Explanation

No detector is trained for them, since they hold lists. A spectrum can always be matched: one is named only where it
closes a part of the gap that the error of calibrated values does not reach.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.paired import Paired
from twingap.gap.search import unlearnt
from twingap.gap.search.effect_search import Estimated, Explanation
from twingap.gap.search.evidence import Compared, Evidence, replicates_of
from twingap.gap.search.free_spectra import BACKGROUND, LINES, PATH, by_fault_or_all, measured
from twingap.gap.search.optimise import validation_distance
from twingap.gap.search.sign_flips import p_of_gain

ASKED: Final = (PATH, LINES, BACKGROUND)
"""In this order: what the path explains is no background."""
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
    names = [name for name in ASKED if evidence.can_add(name) is None]
    if not found.gap or not names:
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
    named: list[Estimated] = []
    tested: dict[str, float] = {}
    for name in names:
        one = measured(evidence, now.simulator, now.effects, (name,), by=by_fault_or_all(evidence))
        if one is None:
            continue
        # Asked of the fit part: names must not be chosen by the closure that is reported.
        nearer = validation_distance(evidence, *one)
        if left - nearer < LEAST * bare:
            continue
        compared = Compared(evidence, one[1], one[0])
        there = Paired(real, made(compared), before.scale)
        if (p := p_of_gain(here, there, evidence.root)) <= LEVEL:
            now, here, left = compared, there, nearer
            tested[name] = p
            named.append(Estimated(next(effect for effect in one[1] if effect.name == name), {}))
    if not named:
        return found
    sure = tuple(one.effect.name for one in named)
    probability = {name: unlearnt.probability(tested[name]) for name in sure}
    return replace(
        found, effects=(*found.effects, *named), after=now, probability={**found.probability, **probability},
        confidence_set=tuple((*names_of, *sure) for names_of in found.confidence_set),
    )  # fmt: skip
