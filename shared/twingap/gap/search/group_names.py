"""Groups of effects that stand in for each other, named together where single members are uncertain."""

from __future__ import annotations

import math
from typing import Final

from twingap.effects import catalogue
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.report.model import GroupName
from twingap.gap.search.effect_search import Explanation

_MEMBER: Final = 0.05
"""Probability from which a member is listed. A smaller value lists members that are hardly possible."""


def groups_of(found: Explanation, learnt: Learnt) -> tuple[GroupName, ...]:
    """Groups of which at least one member is missing at the error rate of single names, the most probable first.

    Members are taken to be missing independently, as in the confidence set.

    Parameters
    ----------
    found : Explanation
    learnt : Learnt
        Its calibration gives the probability from which effects are named.
    """
    if not found.gap:
        return ()
    known = catalogue()
    members: dict[str, dict[str, float]] = {}
    for name, probability in found.probability.items():
        if group := known[name].group:
            members.setdefault(group, {})[name] = min(max(probability, 0.0), 1.0)
    out = []
    for group, own in members.items():
        some = 1 - math.prod(1 - p for p in own.values())
        listed = sorted((name for name, p in own.items() if p >= _MEMBER), key=lambda name: -own[name])
        if some >= learnt.named_from and listed:
            out.append(GroupName(group, tuple(listed), some))
    return tuple(sorted(out, key=lambda one: -one.probability))
