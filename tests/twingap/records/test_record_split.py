"""Splits leak nothing between their parts, lose no record, and let no class vanish unsaid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.bearing import FAULTS
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.records.split import split


def _grouped(groups: list[tuple[list[str | None], int]]) -> RecordSet:
    """Groups of (faults, repeats)."""
    conditions = []
    for g, (faults, repeats) in enumerate(groups):
        for fault in faults * repeats:
            conditions.append(Condition(f"r{len(conditions)}", 1800.0, 12000.0, 1, fault, group=f"g{g}"))
    rng = np.random.default_rng(1)
    records = (Record(conditions[i], rng.standard_normal(1)) for i in rng.permutation(len(conditions)))
    return RecordSet.from_records("a set", "g", None, records)


FAULT_SETS = st.lists(st.none() | st.sampled_from(FAULTS), min_size=1, max_size=3)


@given(
    groups=st.lists(st.tuples(FAULT_SETS, st.integers(1, 3)), min_size=1, max_size=12),
    fractions=st.lists(st.floats(0.05, 1), min_size=1, max_size=4),
    seed=st.integers(0, 5),
    cover=st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_splits_are_disjoint_by_group_and_lose_nothing(
    groups: list[tuple[list[str | None], int]], fractions: list[float], seed: int, cover: bool
) -> None:
    records = _grouped(groups)
    try:
        parts = split(records, fractions, np.random.default_rng(seed), cover_faults=cover)
    except TwingapError:
        # Refused only for cause: too few groups, or a fault that some part cannot have.
        holders = [{c.group for c in records.conditions if c.fault == f} for f in FAULTS]
        several = any(len(set(faults)) > 1 for faults, _ in groups)
        assert len(records.groups) < len(fractions) or (
            cover and (several or any(0 < len(h) < len(fractions) for h in holders))
        )
        return
    assert len(parts) == len(fractions)
    for i, part in enumerate(parts):
        for other in parts[:i]:
            assert not set(part.groups) & set(other.groups)
            assert part.common_groups(other) == ()
        if cover:
            assert {c.fault for c in part.conditions} >= {c.fault for c in records.conditions} - {None}
        places = [records.conditions.index(c) for c in part.conditions]
        assert places == sorted(places)
        for record in part:
            whole = records[records.conditions.index(record.condition)]
            np.testing.assert_array_equal(record.samples, whole.samples)
    assert sorted(c.name for p in parts for c in p.conditions) == sorted(c.name for c in records.conditions)


@given(sizes=st.lists(st.integers(10, 40), min_size=1, max_size=4), seed=st.integers(0, 5))
@settings(max_examples=40, deadline=None)
def test_shares_are_met_per_fault(sizes: list[int], seed: int) -> None:
    groups: list[tuple[list[str | None], int]] = [([FAULTS[f]], 1) for f, n in enumerate(sizes) for _ in range(n)]
    parts = split(_grouped(groups), (0.6, 0.3, 0.1), np.random.default_rng(seed))
    for f, n in enumerate(sizes):
        for part, share in zip(parts, (0.6, 0.3, 0.1), strict=True):
            assert abs(sum(c.fault == FAULTS[f] for c in part.conditions) - share * n) <= 1


def test_splits_are_random_and_repeatable() -> None:
    records = _grouped([(["inner"], 1)] * 8 + [(["outer"], 1)] * 8)
    splits = [split(records, (1, 1), np.random.default_rng(seed))[0].groups for seed in (0, 0, 1, 2)]
    assert splits[0] == splits[1]
    assert len(set(splits)) == 3


def test_a_class_does_not_vanish_silently() -> None:
    records = _grouped([(["healthy"], 2), (["healthy"], 2), (["inner"], 5)])
    rng = np.random.default_rng(0)
    with pytest.raises(TwingapError, match="fault 'inner' cannot be in each of 2 parts with groups kept whole: 1 have"):
        split(records, (0.5, 0.5), rng)
    assert len(split(records, (0.5, 0.5), rng, cover_faults=False)) == 2


def test_too_few_groups() -> None:
    records = _grouped([(["inner", "outer"], 9)])
    with pytest.raises(TwingapError, match="has 1 groups, too few for 2 parts"):
        split(records, (0.5, 0.5), np.random.default_rng(0))
    for fractions in ((), (0.5, 0.0), (0.5, -0.5), (np.nan, 1.0), (np.inf,)):
        with pytest.raises(TwingapError, match="positive numbers expected"):
            split(records, fractions, np.random.default_rng(0))
