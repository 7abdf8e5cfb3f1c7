"""Revolutions between rows: mean speed times time, nothing over a standstill, gaps as asked."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twingap.prognosis.revolutions import Gaps, RevolutionCount

SPEEDS = st.lists(st.floats(1.0, 1e5), min_size=2, max_size=60)


def counted(speeds_rpm: list[float], times_s: list[float], gaps: Gaps = "running") -> tuple[float, list[str]]:
    count, notes = RevolutionCount(gaps), []
    for time_s, speed_rpm in zip(times_s, speeds_rpm, strict=True):
        notes += count.take(time_s, speed_rpm)
    return count.revolutions, notes


@given(SPEEDS, st.floats(1e-3, 1e6))
def test_even_rows_are_counted_by_the_trapezoidal_rule(speeds_rpm: list[float], dt_s: float) -> None:
    times_s = [dt_s * row for row in range(len(speeds_rpm))]
    turned, notes = counted(speeds_rpm, times_s)
    assert turned == pytest.approx(np.trapezoid(speeds_rpm, times_s) / 60, rel=1e-9) and not notes


@pytest.mark.parametrize(("gaps", "turned"), [("running", 10.0 * 29 + 990.0), ("stopped", 10.0 * 28)])
@pytest.mark.parametrize("place", [1, 2, 5, 20, 28])
def test_a_gap_is_counted_as_asked_wherever_it_lies(place: int, gaps: Gaps, turned: float) -> None:
    times_s = [10.0 * row + 990.0 * (row > place) for row in range(30)]
    found, notes = counted([60.0] * 30, times_s, gaps)
    assert found == pytest.approx(turned)
    (note,) = notes
    assert note.startswith(f"gap of 1000 s before time_s = {times_s[place + 1]:g}: its revolutions are ")
    assert note.endswith("counted at 60 rpm" if gaps == "running" else "not counted")


def test_nothing_turns_to_or_from_a_standstill_and_a_missing_speed_is_the_last_one() -> None:
    assert counted([60.0, 0.0, 60.0, 60.0], [0.0, 10.0, 20.0, 30.0])[0] == pytest.approx(10.0)
    assert counted([60.0, float("nan"), 60.0], [0.0, 10.0, 20.0])[0] == pytest.approx(20.0)
    assert counted([60.0, -60.0, 60.0], [0.0, 10.0, 20.0])[0] == 0.0
