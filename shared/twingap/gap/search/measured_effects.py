"""Effects that are measured from spectra, named where held-out records are closer to the twin with them.

verdict's twin --path, background, lines measured, beside its effects or in the place of those that stand in for them-->
    much closer to the fit part? closer to held-out records, too? --> Explanation

No detector is trained for them, since they hold lists. A spectrum can always be matched: one is named only where it
closes a part of the gap that the error of calibrated values does not reach.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from twingap.effects.registry import catalogue, look_alikes, measured_from_spectra
from twingap.effects.transfer_path import gain_spread_db, passed_by_all_samples
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.search import unlearnt
from twingap.gap.search.effect_search import ALPHA_REST, Estimated, Explanation
from twingap.gap.search.evidence import Compared, Evidence
from twingap.gap.search.free_spectra import BACKGROUND, LINES, PATH, Chain, by_fault_or_all, measured
from twingap.gap.search.initial_values import observations
from twingap.gap.search.optimise import validation_distance
from twingap.gap.search.path_delays import with_delays
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
_MOST: Final = 0.5
"""Part of that distance from which lines are asked for though the learnt test finds no rest: it knows no lists of
lines. A smaller value asks more often, with the same consequences."""
_CLEAR: Final = 2.0
"""Distance, over its floor, from which a part of it can be told. A smaller value names some that fit chance."""
_CERTAIN: Final = 0.9
"""Probability from which a path does not replace an effect that is told from paths. A smaller value keeps more of
them where the machine has a path."""
_FLAT: Final = 0.6
"""Spread of a path's gain beside effects, over its spread without them, below which the path does not replace them:
they account for most of its gain. A larger value names fewer paths."""
_REPLICATES: Final = 3
"""Simulations of every held-out record that a test averages. A larger number gives the test more power."""


def with_measured(evidence: Evidence, found: Explanation) -> Explanation:
    """The explanation, of effects with detectors, with those effects that are measured from spectra and named."""
    # In the order of the catalogue: what the path explains is no background.
    names = [name for name in measured_from_spectra() if evidence.can_add(name) is None]
    if not found.gap or not names:
        return found
    bare = validation_distance(evidence, found.before.simulator, ())
    left = validation_distance(evidence, found.after.simulator, found.after.effects)
    if left < _LEFT * bare:
        return found
    # Where no rest points to a further effect, one may still be in the place of those that are taken for it.
    more = not found.effects or found.rest_p <= ALPHA_REST or found.line_order is not None
    real = evidence.held_out.vectors
    seen = observations(evidence, evidence.against().held_out)
    shown = [one.effect.name for one in found.effects if catalogue()[one.effect.name].certain(seen)]

    def made(compared: Compared) -> list[FeatureVectors]:
        return evidence.held_out_replicates(compared.simulator, compared.effects, _REPLICATES)

    before = Paired(real, made(found.before))
    whole = float(before.over_domains(before.squares())[0][0])
    if whole < _CLEAR * before.floor(np.random.default_rng(evidence.root))[0]:
        return found
    now, here = found.after, before if found.after.effects == () else Paired(real, made(found.after), before.scale)
    tested: dict[str, float] = {}
    for name in names:
        if _has(now.effects, name):
            continue
        # Asked of the fit part: names must not be chosen by the closure that is reported.
        rest = tuple(
            effect for effect in now.effects if effect.measured or effect.name not in _replaceable(name, found, shown)
        )
        asked = more or (name == LINES and left > _MOST * bare)
        ways = list(_ways(evidence, now, name)) if asked and (name != PATH or rest == now.effects) else []
        if rest != now.effects and (asked or name == PATH):
            ways += _ways(evidence, evidence.against(rest), name)
        # Each effect that is measured has to close its part.
        costs = [validation_distance(evidence, *way) + LEAST * bare * _unspecific(now.effects, way[1]) for way in ways]
        if not ways or min(costs) > left:
            continue
        way = ways[costs.index(min(costs))]
        if name == PATH and not _is_needed(evidence, now, way, LEAST * bare):
            continue
        nearer = validation_distance(evidence, *way)
        if name == PATH:
            nearer, way = _without_surrogates(evidence, nearer, way, LEAST * bare, _replaceable(PATH, found, shown))
        compared = Compared(evidence, way[1], way[0])
        there = Paired(real, made(compared), before.scale)
        if (p := p_of_gain(here, there, evidence.root)) <= LEVEL:
            tested.update({effect.name: p for effect in way[1] if effect not in now.effects and effect.measured})
            now, here, left = compared, there, nearer
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


def _replaceable(name: str, found: Explanation, shown: Collection[str]) -> Collection[str]:
    """Effects that a measured effect may replace; those of `shown` are certain by what the records show.

    A background replaces none: it is coloured noise in a free form, not another cause.
    """
    if name == BACKGROUND:
        return ()
    certain = {
        n for n, p in found.probability.items()
        if name == PATH and p >= _CERTAIN and (n in shown or catalogue()[n].told_from_paths)
    }  # fmt: skip
    return [other for other in look_alikes(name) if other not in certain]


def _is_needed(evidence: Evidence, now: Compared, way: tuple[Simulator, Chain], least: float) -> bool:
    """Whether nothing simpler accounts for what a path closes: lines or background alone, or effects of the twin."""
    nearer, chain = validation_distance(evidence, *way), way[1]
    if _has(chain, LINES) and not _has(now.effects, LINES):
        alone = next(_ways(evidence, now, LINES), None)
        limit = nearer + least * (_unspecific(now.effects, chain) - 1)
        if alone is not None and validation_distance(evidence, *alone) <= limit:
            return False
    replaced = _names(now.effects) - _names(chain)
    if not replaced:
        return True
    if _has(chain, BACKGROUND) and replaced <= set(look_alikes(BACKGROUND)):
        # The mode calibrated with these effects, or without them: noise that is not modelled widens it.
        others = tuple(effect for effect in now.effects if effect.name not in replaced)
        starts = evidence.against(others), Compared(evidence, others, now.simulator)
        ways = [one for start in starts for one in _ways(evidence, start, BACKGROUND)]
        if any(validation_distance(evidence, *one) < nearer + least for one in ways):
            return False
    path = next(effect for effect in chain if effect.name == PATH)
    if not passed_by_all_samples(path):
        return True
    beside = measured(evidence, evidence.without_added(now.simulator), now.effects, (PATH,), all_samples=True)
    return beside is None or gain_spread_db(beside[1][-1]) >= _FLAT * gain_spread_db(path)


def _names(effects: Chain) -> set[str]:
    """Names of effects."""
    return {effect.name for effect in effects}


def _has(effects: Chain, name: str) -> bool:
    """Whether an effect is among these."""
    return name in _names(effects)


def _unspecific(before: Chain, after: Chain) -> int:
    """Number of measured effects that are new, less those effects in whose place they are.

    Lines in the place of effects with a known cause count for two more: a list of lines is closer than any of them.
    """
    new, gone = _names(after) - _names(before), _names(before) - _names(after)
    return len(new) - len(gone) + 2 * bool(LINES in new and PATH not in new and gone)


def _ways(evidence: Evidence, now: Compared, name: str) -> Iterator[tuple[Simulator, Chain]]:
    """The twin with an effect as measured; a path beside the background, also beside lines, and of all samples.

    Noise of the bearing passes its path, too, so that the twin's noise no longer fits; lines in the records would be
    taken for impacts. Finished waveforms may pass a path as a whole.
    """
    simulator, by = evidence.without_added(now.simulator), by_fault_or_all(evidence)
    if name != PATH:
        one = measured(evidence, simulator, now.effects, (name,), by=by)
        yield from [] if one is None else [one]
        return
    alike = look_alikes(LINES)
    without_lines = tuple(effect for effect in now.effects if effect.measured or effect.name not in alike)
    choices: list[tuple[Chain, tuple[str, ...]]] = [(now.effects, (PATH, BACKGROUND))]
    choices += [(without_lines, (PATH, BACKGROUND, LINES))] if without_lines != now.effects else []
    for effects, names in choices:
        if (one := measured(evidence, simulator, effects, names, by=by)) is not None:
            yield with_delays(evidence, *one)
    if evidence.against().simulator.makes_waveforms:
        one = measured(evidence, simulator, now.effects, (PATH,), all_samples=True)
        yield from [] if one is None else [with_delays(evidence, *one)]


def _without_surrogates(
    evidence: Evidence, distance: float, twin: tuple[Simulator, Chain], least: float, replaceable: Collection[str]
) -> tuple[float, tuple[Simulator, Chain]]:
    """The twin without effects that stand in for its path, and its distance.

    One that closes `least` beside it stays.
    """
    all_samples = any(passed_by_all_samples(effect) for effect in twin[1])
    by = "all" if all_samples else by_fault_or_all(evidence)
    for effect in twin[1]:
        if effect.name not in replaceable or effect.measured:
            continue
        rest = tuple(other for other in twin[1] if other.name != effect.name)
        names = [other.name for other in rest if other.name in (PATH, BACKGROUND)]
        again = measured(evidence, twin[0], rest, names, by=by, all_samples=all_samples)
        if again is not None and (other := validation_distance(evidence, *again)) < distance + least:
            distance, twin = other, again
    return distance, twin
