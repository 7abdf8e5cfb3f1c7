"""Splits of a record set without leakage: all records of one group lie in the same part."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.records.model import RecordSet

_ATTEMPTS = 50  # random restarts where groups hold several faults; more find rarer feasible splits


def split(
    records: RecordSet, fractions: Sequence[float], rng: np.random.Generator, *, cover_faults: bool = True
) -> tuple[RecordSet, ...]:
    """Split a record set at random into parts that share no group.

    Parameters
    ----------
    records : RecordSet
    fractions : sequence of float
        Relative share of the groups in each part, positive. Groups are never divided, so shares are approximate.
    rng : numpy.random.Generator
    cover_faults : bool
        True: every known fault has groups in every part, in about these shares (iterative stratification), or the
        split is refused. False: groups are assigned regardless of their faults, and a class may be absent from a part.

    Returns
    -------
    tuple of RecordSet
        One per fraction, none empty, each in the original order; their union is the set.

    Raises
    ------
    TwingapError
        When there are too few groups.

    References
    ----------
    K. Sechidis, G. Tsoumakas, I. Vlahavas, On the stratification of multi-label data, ECML PKDD 2011,
    doi:10.1007/978-3-642-23808-6_10: the rarest label is assigned first, each time to the part with the largest
    deficit.
    """
    shares = np.asarray(fractions, dtype=float)
    if shares.size < 1 or not all(isfinite(f) and f > 0 for f in shares):
        raise TwingapError(f"fractions = {tuple(fractions)}, positive numbers expected", where="split")
    shares = shares / shares.sum()
    labels = _labels(records, cover_faults)
    if len(labels) < len(shares):
        raise TwingapError(
            f"has {len(labels)} groups, too few for {len(shares)} parts",
            where=f"record set {records.name!r}",
            mend="split into fewer parts, or name finer groups where records are truly independent",
        )
    for _ in range(_ATTEMPTS):
        part_of = _deal(labels, shares, rng)
        lost = _lost_fault(labels, part_of, len(shares)) if cover_faults else None
        if lost is None:
            break
    else:
        n_groups = sum(lost in faults for faults in labels.values())
        raise TwingapError(
            f"fault {lost!r} cannot be in each of {len(shares)} parts with groups kept whole: {n_groups} have it",
            where=f"record set {records.name!r}",
            mend="split into fewer parts, or pass cover_faults=False to let a part do without it",
        )
    places: list[list[int]] = [[] for _ in shares]
    for place, condition in enumerate(records.conditions):
        places[part_of[condition.group or condition.name]].append(place)
    parts = tuple(records.take(kept) for kept in places)
    _verify(records, parts)
    return parts


def _labels(records: RecordSet, by_fault: bool) -> dict[str, frozenset[str]]:
    """Group -> the faults in it ("" = unknown)."""
    labels: dict[str, set[str]] = {}
    for condition in records.conditions:
        labels.setdefault(condition.group or condition.name, set()).add((condition.fault or "") if by_fault else "")
    return {group: frozenset(faults) for group, faults in labels.items()}


def _deal(labels: dict[str, frozenset[str]], shares: NDArray[np.float64], rng: np.random.Generator) -> dict[str, int]:
    """Group -> part."""
    names = list(labels)
    left = {names[i]: labels[names[i]] for i in rng.permutation(len(names))}
    every = sorted(set().union(*labels.values()))
    lacking = {label: shares * sum(label in faults for faults in labels.values()) for label in every}
    held = {label: np.zeros(len(shares), dtype=int) for label in every}
    lacking_any = shares * len(names)
    part_of: dict[str, int] = {}
    while left:
        counts = {label: sum(label in faults for faults in left.values()) for label in every}
        rarest = min((label for label in every if counts[label]), key=lambda label: counts[label])
        for group in [g for g, faults in left.items() if rarest in faults]:
            new = [sum(held[label][p] == 0 for label in labels[group]) for p in range(len(shares))]
            # First a part without this fault, then one that lacks other faults of the group, then the largest deficit.
            part_of[group] = part = min(
                range(len(shares)),
                key=lambda p: (held[rarest][p] > 0, -new[p], -round(float(lacking[rarest][p]), 9), -lacking_any[p]),
            )
            for label in left.pop(group):
                lacking[label][part] -= 1
                held[label][part] += 1
            lacking_any[part] -= 1
    return part_of


def _lost_fault(labels: dict[str, frozenset[str]], part_of: dict[str, int], n_parts: int) -> str | None:
    """A known fault that some part lacks, or None."""
    for fault in sorted(set().union(*labels.values()) - {""}):
        if len({part_of[group] for group, faults in labels.items() if fault in faults}) < n_parts:
            return fault
    return None


def _verify(records: RecordSet, parts: Sequence[RecordSet]) -> None:
    """Check the guarantees of a split: no record lost or duplicated, no group in two parts."""
    names = [c.name for part in parts for c in part.conditions]
    if sorted(names) != sorted(c.name for c in records.conditions):
        raise AssertionError("a split lost or doubled records")
    for i, part in enumerate(parts):
        for other in parts[i + 1 :]:
            if part.common_groups(other):
                raise AssertionError("a split left a group on two sides")
