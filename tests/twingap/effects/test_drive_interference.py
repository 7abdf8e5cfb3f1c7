"""A pair of lines is certainly a drive's unless it is of few records, or as far apart as another bearing's lines."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from twingap.effects import DriveInterference


def seen(
    *, part: float = 1.0, side_order: float = 5.0, foreign: float = 0.0, order: float = 3.334, faint: float = 0.0
) -> SimpleNamespace:
    """Features of records with a clear pair of lines or, with `faint`, faint side lines of that z in its place."""
    pair = 0.0 if faint else math.log1p(14.0)
    return SimpleNamespace(features={
        "pooled|pair": pair, "pooled|pair.diff": pair - 0.5, "pooled|pair_part": part,
        "pooled|pair_side_order": side_order, "context|speeds": math.log(2.0), "pooled|foreign": foreign,
        "pooled|foreign_order": math.log(order), "pooled|faint_sides": faint, "pooled|faint_sides_rival": 3.0,
        "pooled|faint_sides_order": side_order,
    })  # fmt: skip


@pytest.mark.parametrize("faint", [0.0, 10.0], ids=["clear", "faint"])
def test_side_lines_as_far_apart_as_lines_of_another_bearing_are_no_certain_drive(faint: float) -> None:
    assert DriveInterference.certain(seen(faint=faint))
    # Ten orders apart: three times the other bearing's 3.334 orders, where that bearing is clear.
    assert not DriveInterference.certain(seen(faint=faint, foreign=3.5))
    assert DriveInterference.certain(seen(faint=faint, foreign=2.0))
    assert DriveInterference.certain(seen(faint=faint, foreign=3.5, order=3.7))
    # A drive's own side lines are such a line of the envelope.
    assert DriveInterference.certain(seen(faint=faint, foreign=3.5, order=4.98))
    assert DriveInterference.shows_gap(seen(faint=10.0))
    assert not DriveInterference.shows_gap(seen(faint=10.0, foreign=3.5))


def test_a_clear_pair_that_many_records_do_not_share_is_no_certain_drive() -> None:
    assert not DriveInterference.certain(seen(part=0.8))
