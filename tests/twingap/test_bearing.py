"""Bearing kinematics as properties, for any bearing that can be built."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twingap import BEARINGS, Bearing, TwingapError


@st.composite
def bearings(draw: st.DrawFn) -> Bearing:
    """Any geometry whose rollers fit on the pitch circle."""
    rollers = draw(st.integers(3, 60))
    pitch = draw(st.floats(1, 2000))
    part = draw(st.floats(0.01, 0.999))
    return Bearing("any", rollers, part * pitch * math.sin(math.pi / rollers), pitch, draw(st.floats(0, 89)))


SLIP = st.floats(0.8, 1.2)


@given(bearings())
def test_races_share_the_rollers(bearing: Bearing) -> None:
    assert bearing.bpfo + bearing.bpfi == pytest.approx(bearing.n_rollers, rel=1e-15, abs=0)
    assert 0 < bearing.ftf < 0.5
    assert bearing.bpfo < bearing.bpfi
    assert bearing.bpfo == pytest.approx(bearing.n_rollers * bearing.ftf)


@given(bearings(), SLIP)
def test_races_share_the_rollers_when_the_cage_slips(bearing: Bearing, ratio: float) -> None:
    orders = bearing.slipped(ratio)
    assert orders["outer"] + orders["inner"] == pytest.approx(bearing.n_rollers, rel=1e-15, abs=0)
    assert orders["cage"] == pytest.approx(ratio * bearing.ftf)
    assert orders["outer"] == pytest.approx(ratio * bearing.bpfo)


@given(bearings(), SLIP)
def test_side_lines_are_apart_by_the_turns_of_a_defect_through_the_load_zone(bearing: Bearing, ratio: float) -> None:
    orders = bearing.slipped(ratio)
    assert bearing.side_line_order("inner", ratio) == 1.0
    assert bearing.side_line_order("ball", ratio) == orders["cage"]
    assert bearing.side_line_order("ball") == bearing.ftf
    assert bearing.side_line_order("outer") is None
    assert bearing.side_line_order("cage") is None


@given(bearings())
def test_no_slip_is_the_kinematic_bearing(bearing: Bearing) -> None:
    for fault, order in bearing.slipped(1.0).items():
        assert order == pytest.approx(bearing.fault_order(fault), rel=1e-12)


@given(bearings())
def test_rollers_roll_without_slip_on_both_races(bearing: Bearing) -> None:
    """In the cage's frame the contact points of ring and roller move alike: a second road to cage and spin speed."""
    d, big = bearing.roller_diameter_mm, bearing.pitch_diameter_mm
    along = d * math.cos(math.radians(bearing.contact_angle_deg))
    inner, outer = (1 - bearing.ftf) * (big - along), bearing.ftf * (big + along)
    assert inner == pytest.approx(outer, rel=1e-9)
    assert bearing.bsf * d == pytest.approx(inner, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        # Case Western Reserve University's own table of multiples of running speed, 6205 and 6203.
        ("6205", {"inner": 5.4152, "outer": 3.5848, "cage": 0.39828, "ball": 4.7135}),
        ("6203", {"inner": 4.9469, "outer": 3.0530, "cage": 0.3817, "ball": 3.9874}),
        ("NICE", {"inner": 4.7552, "outer": 3.2448}),  # MFPT: 118.88 and 81.12 Hz at 25 Hz
        ("ER-16K", {"inner": 5.43, "outer": 3.57}),  # University of Ottawa
    ],
)
def test_published_orders(name: str, expected: dict[str, float]) -> None:
    for fault, order in expected.items():
        assert BEARINGS[name].fault_order(fault) == pytest.approx(order, rel=2e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((2, 5.0, 30.0, 0.0), "n_rollers = 2"),
        ((9, 40.0, 30.0, 0.0), "0 < roller < pitch"),
        ((9, -1.0, 30.0, 0.0), "0 < roller < pitch"),
        ((9, math.nan, 30.0, 0.0), "0 < roller < pitch"),
        ((9, 5.0, math.inf, 0.0), "0 < roller < pitch"),
        ((9, 5.0, 30.0, 90.0), "contact_angle_deg = 90"),
        ((9, 5.0, 30.0, math.nan), "contact_angle_deg = nan"),
        ((30, 7.94, 39.04, 0.0), "30 rollers of 7.94 mm do not fit"),
    ],
)
def test_impossible_bearings_are_refused(arguments: tuple[int, float, float, float], message: str) -> None:
    with pytest.raises(TwingapError, match=message) as caught:
        Bearing("odd", *arguments)
    assert str(caught.value).startswith("bearing 'odd': ")


@pytest.mark.parametrize("fault", ["healthy", "cracked", ""])
def test_no_order_for_no_fault(fault: str) -> None:
    with pytest.raises(TwingapError, match=f"no fault order for fault '{fault}'; use one of inner, outer, ball, cage"):
        BEARINGS["6205"].fault_order(fault)
