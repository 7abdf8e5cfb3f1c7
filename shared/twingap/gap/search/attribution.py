"""Attribution: what of the gap each group of effects closes in the closest twin.

subsets of groups --twin with these groups alone--> closure on held-out records --Shapley values--> share of each group
without a group, without an effect --differences by group of records, signs flipped--> p-value

Effects that stand in for each other share what they close: a Shapley value is the mean gain of a group over all orders
in which groups can be added, and all of them add up to the closure (Shapley 1953; Lundberg & Lee 2017,
arXiv:1705.07874).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import permutations
from typing import Final

import numpy as np
from scipy.stats import false_discovery_control

from twingap.effects import Effect
from twingap.gap.distance.closure import closure, percentile_interval
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.report.model import EffectShare, GroupShare
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.sign_flips import p_of_gain
from twingap.records import Array
from twingap.twins.simulator import Simulator

Chain = tuple[Effect, ...]
Made = Callable[[Simulator, Chain], list[FeatureVectors]]

ORDERS: Final = 8
"""Largest number of orders in which groups are added. A larger number makes shares more exact and takes longer."""
DRAWS: Final = 200
"""Bootstrap draws of an interval. More make its ends more exact."""
FALSE_DISCOVERIES: Final = 0.1
"""False discovery rate at which a group or an effect counts as shown. A larger value names more of them."""


def attribution(
    evidence: Evidence,
    simulator: Simulator,
    effects: Chain,
    *,
    real: FeatureVectors,
    before: Sequence[FeatureVectors],
    made: Made,
    refitted: Callable[[Chain], tuple[Simulator, Chain]],
    floor: float,
    rng: np.random.Generator,
    progress: Callable[[float], None] = lambda part: None,
) -> tuple[GroupShare, ...]:
    """Shares of the groups of the closest twin's effects (`simulator`, `effects`), the largest first.

    `real` are held-out records, `before` replicates of the twin as given; `made` gives replicates of a simulator with
    effects, and `refitted` the twin with some effects alone, its baseline fitted again. `floor` is the distance that
    sampling alone leaves.
    """
    by_group: dict[str, list[Effect]] = {}
    for effect in effects:
        by_group.setdefault(effect.group or effect.name, []).append(effect)
    groups = list(by_group)
    if not groups:
        return ()
    start = Paired(real, before)
    known: dict[frozenset[str], Paired] = {frozenset(): start}
    scale = start.scale

    def paired_of(names: frozenset[str], members: Chain) -> Paired:
        key = names | {f"effect {effect.name}" for effect in members} if members else names
        if key not in known:
            chain = members or tuple(effect for effect in effects if (effect.group or effect.name) in names)
            whole = len(chain) == len(effects)
            known[key] = Paired(real, made(*((simulator, effects) if whole else refitted(chain))), scale)
        return known[key]

    signs = start.draw_residuals(rng, DRAWS)
    values: dict[frozenset[str], tuple[float, Array]] = {}

    def worth(names: frozenset[str]) -> tuple[float, Array]:
        """Closure of the twin with these groups, and its bootstrap [draws]."""
        if names not in values:
            after = paired_of(names, ())
            gap, left = (float(p.over_domains(p.squares())[0][0]) for p in (start, after))
            drawn = [p.over_domains(p.resampled(signs))[0] for p in (start, after)]
            each = np.array([closure(b, a, floor) for b, a in zip(*drawn, strict=True)])
            values[names] = closure(gap, left, floor), each
        return values[names]

    orders = _orders(groups, rng)
    shares = dict.fromkeys(groups, 0.0)
    drawn_shares = {group: np.zeros(DRAWS) for group in groups}
    for number, order in enumerate(orders):
        before_names: frozenset[str] = frozenset()
        for group in order:
            names = before_names | {group}
            (one, drawn_one), (other, drawn_other) = worth(names), worth(before_names)
            shares[group] += (one - other) / len(orders)
            drawn_shares[group] += (drawn_one - drawn_other) / len(orders)
            before_names = names
        progress((number + 1) / len(orders) * 0.7)
    full = paired_of(frozenset(groups), ())
    found = []
    for number, group in enumerate(groups):
        without = paired_of(frozenset(groups) - {group}, ())
        p = p_of_gain(without, full, evidence.root)
        members = _members(by_group[group], effects, shares[group], full, paired_of)
        ci = percentile_interval(drawn_shares[group], shares[group])
        found.append((group, members, shares[group], ci, p))
        progress(0.7 + 0.3 * (number + 1) / len(groups))
    adjusted = false_discovery_control([row[4] for row in found])
    rows = zip(found, adjusted, strict=True)
    out = (GroupShare(*row, bool(q <= FALSE_DISCOVERIES and row[2] > 0)) for row, q in rows)
    return tuple(sorted(out, key=lambda share: -share.share))


def _orders(groups: Sequence[str], rng: np.random.Generator) -> list[tuple[str, ...]]:
    """All orders of few groups, or random ones, each with its reverse."""
    if math.factorial(len(groups)) <= ORDERS:
        return list(permutations(groups))
    out: list[tuple[str, ...]] = []
    while len(out) < ORDERS:
        order = tuple(groups[i] for i in rng.permutation(len(groups)))
        out += [order, order[::-1]]
    return out


def _members(
    members: Sequence[Effect], effects: Chain, share: float, full: Paired,
    paired_of: Callable[[frozenset[str], Chain], Paired],
) -> tuple[EffectShare, ...]:  # fmt: skip
    """Share of each effect of a group: in proportion to what is lost without it, if anything is."""
    if len(members) == 1:
        return (EffectShare(members[0].name, share),)
    gap = float(full.over_domains(full.squares())[0][0])
    lost: dict[str, float] = {}
    for effect in members:
        others = tuple(one for one in effects if one is not effect)
        pair = paired_of(frozenset(), others)
        lost[effect.name] = max(float(pair.over_domains(pair.squares())[0][0]) - gap, 0.0)
    total = sum(lost.values())
    parts = [EffectShare(n, share * (own / total if total > 0 else 1 / len(lost))) for n, own in lost.items()]
    return tuple(sorted(parts, key=lambda part: -abs(part.share)))
