"""The buffer: whatever the order of arrival, what comes out is in order; every case is counted; memory is bounded."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from papers.paper2_digital_twin.live_twin import OrderOptions, Reorder, Snapshot, StateMessage
from papers.paper2_digital_twin.live_twin.order import BEGUN_ANEW
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


@given(st.lists(st.floats(0, 1000), min_size=1, max_size=60), st.integers(1, 8), st.floats(0, 200))
@settings(max_examples=60, deadline=None)
def test_what_comes_out_never_goes_back_in_time_and_memory_is_bounded(
    times: list[float], capacity: int, lateness_s: float
) -> None:
    buffer, out, most = Reorder(OrderOptions(lateness_s=lateness_s, capacity=capacity)), [], 0
    for t in times:
        out += buffer.push(state(t))
        most = max(most, buffer.held)
    out += buffer.flush()
    assert most <= capacity
    assert all(a.time_s <= b.time_s for a, b in itertools.pairwise(out))
    n = {case: buffer.counts["state", case] for case in ("accepted", "repeated", "late")}
    assert len(out) == n["accepted"] and sum(n.values()) == len(times)


def test_each_case_is_counted() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
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


def test_one_clock_gone_mad_does_not_carry_the_watermark_away_but_two_that_agree_do() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
    buffer.push(state(0))
    assert buffer.push(state(1e9)) == [] and buffer.counts["state", "from the future"] == 1
    buffer.push(state(20))
    assert buffer.counts["state", "late"] == 0 and buffer.watermark_s == 10.0
    buffer.push(state(50_000))
    buffer.push(state(50_010))  # the line was down for half a day
    assert buffer.watermark_s == 50_000


def test_a_first_message_with_a_wrong_clock_does_not_make_the_rest_late() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
    out = [m.time_s for t in (4e9, 0.0, 20.0, 15.0, 40.0) for m in buffer.push(state(t))]
    out += [m.time_s for m in buffer.flush()]
    assert out == [0.0, 15.0, 20.0, 40.0]
    counts = {case: n for (_, case), n in buffer.counts.items() if n}
    assert counts == {"accepted": 4, "out of order": 1, "from the future": 1}


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
    assert buffer.counts["snapshot", "unusable"] == 1 and buffer.held == 0


def test_impossible_patience_is_refused() -> None:
    with pytest.raises(TwingapError, match="capacity = 0, at least 1 expected"):
        OrderOptions(capacity=0)


def test_what_came_before_the_first_message_was_never_missing() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0))
    for number, t in ((5, 1000.0), (6, 1060.0), (7, 1300.0), (3, 900.0), (4, 950.0)):
        buffer.push(state(t, number))
    assert buffer.counts["state", "late"] == 2 and buffer.counts["state", "missing"] == 0


def test_a_message_from_the_future_does_not_vouch_for_itself() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0, remembered=1))
    buffer.push(state(0, 0))
    for t in (1e9, 1e9, 20.0, 1e9):  # one is remembered: the message of now takes its place
        assert all(m.time_s < 1e9 for m in buffer.push(state(t)))
    assert buffer.counts["state", "from the future"] == 1 and buffer.counts["state", "repeated"] == 2
    buffer.push(state(30))
    assert buffer.watermark_s == 20.0 and buffer.counts["state", "late"] == 0
    buffer.push(state(1e9 + 1))
    assert buffer.watermark_s == 1e9 + 1 - 10


def test_one_that_was_left_out_is_known_when_it_comes_again_after_another() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
    for t in (0.0, 1e9, 2e9, 1e9, 2e9):
        buffer.push(state(t))
    assert buffer.counts["state", "from the future"] == 2 and buffer.counts["state", "repeated"] == 2


@pytest.mark.parametrize("lateness_s", [0.0, 10.0])
@pytest.mark.parametrize("numbered", [False, True])
def test_a_sender_that_starts_again_at_zero_is_heard(lateness_s: float, numbered: bool) -> None:
    """Times and numbers of its first start come again; so do, in two messages, the values: then nothing differs."""
    buffer, out = Reorder(OrderOptions(lateness_s=lateness_s, ahead_s=1000.0)), []
    sent = [state(10.0 * i, i if numbered else None, 40 + i % 7) for i in range(200)]
    again = [state(10.0 * i, i if numbered else None, 40 + i % 7 + (i not in (0, 3))) for i in range(300)]
    for message in (*sent, *again):
        out += buffer.push(message)
    out += buffer.flush()
    assert out == [*sent, *(m for i, m in enumerate(again) if i not in (0, 3))]
    counts = {case: n for (_, case), n in buffer.counts.items() if n}
    # Number 3 is missing among 1, 2, 4, ...; 0 came before the first of the new stream.
    assert counts == {"accepted": 498, "begun anew": 1, "repeated": 2} | ({"missing": 1} if numbered else {})


def test_messages_of_days_ago_delivered_again_are_repeated_however_many() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
    sent = [state(10.0 * i, i) for i in range(200)]
    for message in (*sent, *sent[:50]):
        buffer.push(message)
    assert buffer.counts["state", "repeated"] == 50 and buffer.counts["state", "begun anew"] == 0


@pytest.mark.parametrize("lateness_s", [0.0, 10.0])
def test_first_messages_dated_by_a_clock_not_yet_set_do_not_make_the_rest_late(lateness_s: float) -> None:
    buffer, out = Reorder(OrderOptions(lateness_s=lateness_s, ahead_s=1000.0)), []
    for t in (4e9, 4e9 + 20, 4e9 + 40, *(10.0 * i for i in range(50))):
        out += [m.time_s for m in buffer.push(state(t))]
    out += [m.time_s for m in buffer.flush()]
    assert out == [4e9, 4e9 + 20, 4e9 + 40, *(10.0 * i for i in range(50))]
    assert buffer.counts["state", "late"] == 0 and buffer.counts["state", "begun anew"] == 1
    assert buffer.watermark_s == 490.0 - lateness_s


def test_what_was_counted_of_messages_behind_is_taken_back_when_the_stream_begins_anew_with_them() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
    for number in (0, 1, 9, 10, 11):
        buffer.push(state(1e6 + 10 * number, number))
    assert buffer.counts["state", "missing"] == 7
    for number in range(BEGUN_ANEW - 1):
        buffer.push(state(10.0 * number, number + 3))
    assert buffer.counts["state", "missing"] == 7 - 4 and buffer.counts["state", "late"] == 4
    buffer.push(state(10.0 * BEGUN_ANEW, 3 + BEGUN_ANEW))  # number 7 is lost, of the new stream
    buffer.flush()
    assert buffer.counts["state", "missing"] == 7 + 1 and buffer.counts["state", "late"] == 0


@given(st.data(), st.floats(0, 500), st.integers(1, 8), st.integers(1, 4096))
@settings(max_examples=50, deadline=None)
def test_late_messages_do_not_set_the_clock_back(
    data: st.DataObject, lateness_s: float, capacity: int, remembered: int
) -> None:
    """However many, where they are no further behind than `ahead_s`; a few in a row, where they are."""
    options = OrderOptions(lateness_s=lateness_s, capacity=capacity, ahead_s=1000.0, remembered=remembered)
    buffer, out = Reorder(options), []
    for i in range(data.draw(st.integers(1, 12))):
        now = 1e6 + 100.0 * i
        out += buffer.push(state(now))
        for back in data.draw(st.lists(st.floats(0, 1000), max_size=10)):
            out += buffer.push(state(now - back))
        far = [now - t for t in data.draw(st.lists(st.floats(2000, 3000), max_size=BEGUN_ANEW - 1))]
        for t in [*far, *(data.draw(st.lists(st.sampled_from(far), max_size=9)) if far else [])]:  # and repeated
            out += buffer.push(state(t))
    out += buffer.flush()
    assert buffer.counts["state", "begun anew"] == 0
    assert all(a.time_s <= b.time_s for a, b in itertools.pairwise(out))


def test_a_few_in_a_row_that_were_days_on_their_way_are_late_however_often() -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
    buffer.push(state(1e6 - 100.0))
    for i in range(20):
        buffer.push(state(1e6 + 100.0 * i))
        for late in range(BEGUN_ANEW - 1):
            buffer.push(state(100.0 * i + late))
    assert buffer.counts["state", "late"] == 20 * (BEGUN_ANEW - 1) and buffer.counts["state", "begun anew"] == 0


@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=40))
@settings(max_examples=100, deadline=None)
def test_messages_behind_that_do_not_agree_do_not_set_the_clock_back(times: list[float]) -> None:
    buffer = Reorder(OrderOptions(lateness_s=10.0, ahead_s=1000.0))
    for t in (1e9, 1e9 + 20.0):
        buffer.push(state(t))
    last, agreeing = -1e9, 0
    for t in times:
        agreeing = agreeing + 1 if abs(t - last) <= 1000 else 1
        if agreeing < BEGUN_ANEW:
            buffer.push(state(t))
            last = t
        else:
            agreeing -= 1
    assert buffer.counts["state", "begun anew"] == 0


@pytest.mark.parametrize("fault", ["cage", "", "nonsense"])
def test_a_snapshot_of_a_fault_without_a_contact_model_is_unusable(fault: str) -> None:
    buffer = Reorder()
    buffer.push(Snapshot(0.0, np.random.default_rng(0).standard_normal(4096), 12000.0, fault))
    assert buffer.counts["snapshot", "unusable"] == 1 and buffer.held == 0


@pytest.mark.parametrize("speed_rpm", [-1.0, float("nan"), float("inf")])
def test_standstill_is_a_state_and_an_impossible_speed_is_none(speed_rpm: float) -> None:
    assert StateMessage(0.0, 40.0, 0.0).usable and not StateMessage(0.0, 40.0, speed_rpm).usable
