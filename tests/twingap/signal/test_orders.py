"""Order tracking: what turns with the shaft becomes sharp, and nothing folds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.errors import TwingapError
from twingap.signal import (
    amplitude_spectrum,
    order_spectrum,
    synchronous_average,
    to_angle,
    turns_from_speed,
    turns_from_tacho,
    without_average,
)

FS_HZ = 10000.0
T = np.arange(20000) / FS_HZ


def run_up(start_hz, end_hz):
    """Turns of a shaft whose speed rises evenly."""
    return start_hz * T + (end_hz - start_hz) * T**2 / (2 * T[-1])


@settings(max_examples=15, deadline=None)
@given(start=st.floats(10, 30), ratio=st.floats(1.1, 3.0), order=st.integers(2, 40))
def test_harmonics_of_a_chirping_shaft_become_sharp_lines(start, ratio, order):
    turns = run_up(start, start * ratio)
    x = 2.0 * np.cos(2 * np.pi * order * turns + 1.0)
    tracked = order_spectrum(x, turns, 128)
    line = tracked.values.argmax()
    assert tracked.frequency[line] == pytest.approx(order, abs=1e-9)
    assert tracked.values[line] == pytest.approx(2.0, rel=0.02)
    # A Hann line is three bins wide; beyond twice that next to nothing is left, except from the record's ends.
    assert np.delete(tracked.values, np.arange(line - 6, line + 7)).max() < 0.02
    if order * start * (ratio - 1) > 20:
        assert amplitude_spectrum(x, FS_HZ).values.max() < 1.0


def test_a_steady_shaft_gives_the_plain_spectrum():
    x = np.cos(2 * np.pi * 100 * T) + 0.5 * np.cos(2 * np.pi * 333 * T)
    tracked = order_spectrum(x, 20 * T, 500)
    plain = amplitude_spectrum(x, FS_HZ)
    np.testing.assert_allclose(tracked.at([5.0, 16.65]), plain.at([100.0, 333.0]), rtol=0.01)


def test_equal_steps_give_back_the_samples():
    x = np.random.default_rng(0).standard_normal(500)
    np.testing.assert_allclose(to_angle(x, np.arange(500) / 10, 10)[5:-5], x[5:-5], atol=1e-9)


def test_high_frequencies_do_not_fold_where_the_shaft_is_slow():
    turns = run_up(5.0, 25.0)
    tone = np.cos(2 * np.pi * 3000 * T)  # orders 120 to 600: beyond the 32 that 64 samples a turn can show
    assert np.abs(to_angle(tone, turns, 64)).max() > 0  # something is there: rounding and edges
    assert order_spectrum(tone, turns, 64).values.max() < 0.01
    naive = np.interp(np.arange(0, turns[-1], 1 / 64), turns, tone)
    assert amplitude_spectrum(naive, 64.0).values.max() > 0.05
    kept = order_spectrum(np.cos(2 * np.pi * 25 * turns), turns, 64)
    assert kept.at(25.0) == pytest.approx(1.0, rel=0.03)


def test_frequencies_near_half_the_rate_survive_interpolation():
    turns = 20 * T + 0.1 * np.sin(2 * np.pi * T)
    x = np.cos(2 * np.pi * 205 * turns)  # 4100 Hz, 130 more or less, of 5000
    assert order_spectrum(x, turns, 600).at(205.0) == pytest.approx(1.0, rel=0.03)


def test_speed_is_integrated_exactly_where_it_changes_evenly():
    speed_rpm = np.stack([np.full(T.size, 1200.0), np.linspace(600, 1800, T.size)])
    turns = turns_from_speed(speed_rpm, FS_HZ)
    np.testing.assert_allclose(turns[0], 20 * T, atol=1e-9)
    np.testing.assert_allclose(turns[1], run_up(10.0, 30.0), atol=1e-9)


@pytest.mark.parametrize("per_turn", [1, 8])
def test_tacho_gives_the_angle_back(per_turn):
    turns = run_up(10.0, 30.0)
    pulses = np.interp(np.arange(0.5, turns[-1] - 0.5, 1 / per_turn), turns, T)
    found = turns_from_tacho(pulses, T.size, FS_HZ, pulses_per_turn=per_turn)
    inside = (pulses[2] < T) & (pulses[-3] > T)
    error = found - (turns - 0.5)
    assert np.abs(error[inside]).max() < 0.01 / per_turn
    assert np.abs(error).max() < 0.06
    assert (np.diff(found) > 0).all()


def test_records_of_a_batch_have_their_own_angle_and_the_shortest_length():
    turns = np.stack([run_up(10.0, 20.0), run_up(20.0, 40.0)])
    x = np.cos(2 * np.pi * 5 * turns)
    both = to_angle(x, turns, 32)
    assert both.shape == (2, int(turns[0, -1] * 32) + 1)
    np.testing.assert_allclose(both[1, 50:-50], to_angle(x[1], turns[1], 32)[50 : both.shape[1] - 50], atol=1e-3)
    shared = to_angle(x[:, None], turns[0], 32)
    assert shared.shape == (2, 1, both.shape[1])


def test_average_keeps_the_shaft_and_drops_the_rest():
    per_turn, turns = 64, 100
    angle = np.arange(per_turn * turns + 17) / per_turn
    shaft = np.cos(2 * np.pi * angle) + 0.3 * np.sin(2 * np.pi * 7 * angle)
    rest = np.random.default_rng(1).standard_normal((2, angle.size))
    mean = synchronous_average(shaft + rest, per_turn)
    assert mean.shape == (2, per_turn)
    assert (mean - shaft[:per_turn]).std() == pytest.approx(1 / np.sqrt(turns), rel=0.2)
    left = without_average(shaft + rest, per_turn)
    assert left.shape == rest.shape
    assert amplitude_spectrum(left[:, : per_turn * turns], per_turn, window="boxcar").at([1.0, 7.0]).max() < 1e-6
    assert left.std() == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: turns_from_speed([1000.0, 0.0], 1.0), "speed_rpm falls to 0"),
        (lambda: turns_from_tacho([1.0], 5, 1.0), "at least 2"),
        (lambda: turns_from_tacho([1.0, 1.0], 5, 1.0), "ascending"),
        (lambda: turns_from_tacho([0.0, 1.0], 5, 1.0, pulses_per_turn=0), "pulses_per_turn"),
        (lambda: to_angle(np.zeros(20), np.arange(19.0), 4), "shape"),
        (lambda: to_angle(np.zeros((2, 20)), np.zeros((3, 20)), 4), "shape"),
        (lambda: to_angle(np.zeros(20), np.zeros(20), 4), "do not increase"),
        (lambda: to_angle(np.zeros(20), np.arange(20) / 40, 4), "turns, at least 1"),
        (lambda: to_angle(np.zeros(20), np.arange(20.0), 1), "samples_per_turn"),
        (lambda: synchronous_average(np.zeros(5), 6), "at least 6"),
        (lambda: without_average(np.zeros(5), 0), "samples_per_period"),
    ],
)
def test_refuses_what_cannot_turn(call, message):
    with pytest.raises(TwingapError, match=message):
        call()
