"""A line below the shaft's order is missing where all records share it and the twin does not have it."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Looseness
from twingap.effects.subsynchronous import lacking_line, shared_line

Line = tuple[float, float, float, float]  # order, its error, share, level
NOTHING: Line = (0.61, 0.02, 0.1, 1.0)


def seen(ours: Line, theirs: Line = NOTHING) -> SimpleNamespace:
    features = {}
    for part, value, other in zip(("order", "error", "share", "level"), ours, theirs, strict=True):
        features |= {f"pooled|below_{part}": value, f"pooled|below_{part}.diff": value - other}
    return SimpleNamespace(features=features)


@pytest.mark.parametrize("weak", [(0.44, 0.002, 0.4, 6.0), (0.44, 0.002, 1.0, 2.0), (math.nan,) * 4], ids=str)
def test_weak_lines_and_those_of_some_records_are_none(weak: Line) -> None:
    assert shared_line(seen(weak)) is None
    assert lacking_line(seen(weak)) is None
    assert not Looseness.excluded(seen(weak))


def test_a_line_is_missing_unless_the_twin_has_it_at_its_order() -> None:
    ours = (0.44, 0.002, 1.0, 6.0)
    assert lacking_line(seen(ours)).order == pytest.approx(0.44)
    assert lacking_line(seen(ours, (0.5, 0.001, 1.0, 6.0))).order == pytest.approx(0.44)
    assert lacking_line(seen(ours, (0.445, 0.002, 0.8, 5.0))) is None
    assert lacking_line(seen(ours, (0.445, 0.002, 0.1, 5.0))) is not None


def test_a_loose_part_has_its_line_at_half_the_shafts_order() -> None:
    assert Looseness.excluded(seen((0.46, 0.002, 1.0, 6.0)))
    assert not Looseness.excluded(seen((0.49, 0.002, 1.0, 6.0)))
    assert not Looseness.excluded(seen((0.48, 0.006, 1.0, 6.0)))
    assert not Looseness.excluded(seen((0.3, 0.002, 1.0, 6.0)))  # a belt, beside which a part may be loose


def test_a_cage_without_healthy_records_is_no_missing_line() -> None:
    bearing = BEARINGS["6205"]
    for share, is_line in ((0.3, True), (0.0, False)):
        cage = seen((bearing.ftf * 0.99, 0.002, 1.0, 6.0))
        cage.features["context|healthy_share"], cage.bearing = share, bearing
        assert (lacking_line(cage) is not None) is is_line
    other = seen((0.6, 0.002, 1.0, 6.0))
    other.features["context|healthy_share"], other.bearing = 0.0, bearing
    assert lacking_line(other) is not None


def test_what_is_not_known_is_not_missing() -> None:
    nothing = SimpleNamespace(features={})
    assert shared_line(nothing) is lacking_line(nothing) is None
    assert not Looseness.excluded(nothing)
