"""Confidence set by groups: many explanations as a few, each a choice among effects that stand in for each other.

((a, b), (a, c), (a,)) --groups--> a and one or more of b, c (group); a alone
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal, NamedTuple

from twingap.effects import catalogue
from twingap.gap.report.model import listed

PART: Final = 0.98
"""Part of a confidence set's probability that its listing by groups holds. A larger value lists more, hardly probable
lines."""


class Choice(NamedTuple):
    """Members of a group in an explanation; an effect without a group is one of its own.

    `how` says which of the effects are missing: all of them, one or more, or any or none.
    """

    group: str
    effects: tuple[str, ...]
    how: Literal["all", "some", "perhaps"]

    def __str__(self) -> str:
        if self.how == "all":
            return listed(self.effects)
        words = listed(self.effects, "or")
        return f"perhaps {words}" if self.how == "perhaps" else f"one or more of {self.group} ({words})"


class GroupedSet(NamedTuple):
    """Explanations that hold effects of the same groups: their choices (empty for "no effect"), their number, and their
    part of the confidence set's probability."""

    choices: tuple[Choice, ...]
    explanations: int
    weight: float


def by_groups(
    sets: Sequence[Sequence[str]], probability: Mapping[str, float], part: float = PART
) -> tuple[GroupedSet, ...]:
    """The explanations of a confidence set, those with effects of the same groups taken together.

    Both `sets` and what is returned have the most probable first. The probability that each effect is missing (0.5
    where it is not known) weights the explanations; beyond `part` of the total, the least probable ones are left out.
    """
    open_ = {name for one in sets for name in one if not all(name in other for other in sets)}
    together: dict[frozenset[str], list[tuple[frozenset[str], float]]] = {}
    for one in sets:
        factors = (_bounded(probability.get(n, 0.5)) if n in one else 1 - _bounded(probability.get(n, 0.5))
                   for n in open_)  # fmt: skip
        together.setdefault(frozenset(map(group_of, one)), []).append((frozenset(one), math.prod(factors)))
    total = sum(weight for own in together.values() for _, weight in own)
    order = list(dict.fromkeys(name for one in sets for name in one))
    out = [
        GroupedSet(_choices([one for one, _ in own], order), len(own), sum(weight for _, weight in own) / total)
        for own in together.values()
    ]
    out.sort(key=lambda one: -one.weight)
    before = itertools.accumulate((one.weight for one in out), initial=0.0)
    return tuple(one for one, reached in zip(out, before, strict=False) if reached < part - 1e-9)


def group_of(name: str) -> str:
    """Group of an effect; its own name where it has none."""
    known = catalogue().get(name)
    return (known.group if known is not None else "") or name


def _choices(sets: Sequence[frozenset[str]], order: Sequence[str]) -> tuple[Choice, ...]:
    """Effects by group, certain ones apart from those that only some of the sets hold."""
    everywhere = frozenset.intersection(*sets)
    groups: dict[str, list[str]] = {}
    for name in order:
        if any(name in one for one in sets):
            groups.setdefault(group_of(name), []).append(name)
    out: list[Choice] = []
    for group, names in groups.items():
        sure, others = ([n for n in names if (n in everywhere) is inside] for inside in (True, False))
        if sure:
            out.append(Choice(group, tuple(sure), "all"))
        if others:
            out.append(Choice(group, tuple(others), "perhaps" if sure else "some"))
    return tuple(out)


def _bounded(p: float) -> float:
    """A probability away from 0 and 1, at which every other explanation would weigh nothing."""
    return min(max(p, 1e-3), 1 - 1e-3)
