"""The buffer: whatever the order of arrival, what comes out is in order; every case is counted."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from papers.paper2_digital_twin.live_twin.messages import OrderOptions, Reorder, Snapshot, StateMessage
from twingap.errors import TwingapError


def state(time_s: float, number: int | None = None, temperature_c: float = 40.0) -> StateMessage:
    return StateMessage(time_s, temperature_c, 1800.0, 500.0, number)


@given(st.lists(st.floats(0, 100), min_size=1, max_size=40, unique=True), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_with_enough_patience_any_shuffle_comes_out_in_order(times: list[float], seed: int) -> None:
    buffer = Reorder(OrderOptions(lateness_s=100.0))
    order = np.random.default_rng(seed).permutation(len(times))
    out = [m for i in order for m in buffer.push(state(times[i]))] + buffer.flush()
    assert [m.time_s for m in out] == sorted(times)
    assert buffer.counts["state", "late"] == 0 and buffer.counts["state", "accepted"] == len(times)


@given(st.lists(st.floats(0, 1000), min_size=1, max_size=60), st.floats(0, 200))
@settings(max_examples=60, deadline=None)
def test_what_comes_out_never_goes_back_in_time(times: list[float], lateness_s: float) -> None:
    buffer = Reorder(OrderOptions(lateness_s=lateness_s))
    out = [m for t in times for m in buffer.push(state(t))] + buffer.flush()
    assert all(a.time_s <= b.time_s for a, b in itertools.pairwise(out))
    n = {case: buffer.counts["state", case] for case in ("accepted", "repeated", "late")}
    assert len(out) == n["accepted"] and sum(n.values()) == len(times)


def test_messages_delivered_again_are_repeated_as_far_as_they_are_remembered() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, remembered=50))
    sent = [state(10.0 * i, i) for i in range(200)]
    for message in (*sent, *sent[150:], *sent[:50]):
        buffer.push(message)
    assert buffer.counts["state", "repeated"] == 50 and buffer.counts["state", "late"] == 50


def test_each_case_is_counted() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0))
    for message in (state(0, 0), state(5, 1), state(5, 1), state(40, 4), state(35, 3), state(2, 9)):
        buffer.push(message)
    buffer.push(state(float("nan"), 5))
    buffer.push(state(41, 5, temperature_c=float("nan")))
    buffer.flush()
    counts = {case: n for (_, case), n in buffer.counts.items()}
    assert counts == {"accepted": 4, "repeated": 1, "out of order": 1, "late": 1, "unusable": 2, "missing": 1}


def test_a_message_that_was_only_late_is_no_longer_missing() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0))
    for number, t in enumerate((0.0, 10.0, 30.0, 40.0, 60.0)):
        buffer.push(state(t, number if number < 2 else number + 1))
    assert buffer.counts["state", "missing"] == 1
    buffer.push(state(20.0, 2))
    assert buffer.counts["state", "missing"] == 0 and buffer.counts["state", "late"] == 1


def test_states_come_before_the_snapshot_of_the_same_moment() -> None:
    buffer = Reorder()
    samples = np.random.default_rng(0).standard_normal(4096)
    buffer.push(Snapshot(5.0, samples, 12000.0))
    buffer.push(state(5.0))
    assert [type(m) for m in buffer.flush()] == [StateMessage, Snapshot]


@pytest.mark.parametrize("samples", [np.zeros(4096), np.full(4096, np.nan), np.ones(10)])
def test_a_torn_cable_is_no_snapshot(samples: np.ndarray) -> None:
    buffer = Reorder()
    buffer.push(Snapshot(0.0, samples, 12000.0))
    assert buffer.counts["snapshot", "unusable"] == 1


def test_impossible_patience_is_refused() -> None:
    with pytest.raises(TwingapError, match="remembered = 0, at least 1 expected"):
        OrderOptions(remembered=0)


def test_what_came_before_the_first_message_was_never_missing() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0))
    for number, t in ((5, 1000.0), (6, 1060.0), (7, 1300.0), (3, 900.0), (4, 950.0)):
        buffer.push(state(t, number))
    assert buffer.counts["state", "late"] == 2 and buffer.counts["state", "missing"] == 0


@pytest.mark.parametrize("fault", ["cage", "", "nonsense"])
def test_a_snapshot_of_a_fault_without_a_contact_model_is_unusable(fault: str) -> None:
    buffer = Reorder()
    buffer.push(Snapshot(0.0, np.random.default_rng(0).standard_normal(4096), 12000.0, fault))
    assert buffer.counts["snapshot", "unusable"] == 1


@pytest.mark.parametrize("speed_rpm", [-1.0, float("nan"), float("inf")])
def test_standstill_is_a_state_and_an_impossible_speed_is_none(speed_rpm: float) -> None:
    assert StateMessage(0.0, 40.0, 0.0).usable and not StateMessage(0.0, 40.0, speed_rpm).usable
