"""Influence of speed through its points and no further; the anomaly's rule holds the rate that it states."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.errors import TwingapError
from twingap.prognosis import (
    AnomalyRule,
    detect_anomaly,
    deviations,
    fit_speed_influence,
    normalised_peak_to_peak,
    speed_constants,
)
from twingap.prognosis.anomaly import Array, rank

STEPS = np.arange(1000.0, 2001.0, 100.0)


def resonant(speed_rpm: Array) -> Array:
    """Peak to peak that rises with speed and crosses a resonance at 1400 rpm."""
    return speed_rpm / 1000 + 3 / (1 + ((speed_rpm - 1400) / 80) ** 2)


# -- S(k) -------------------------------------------------------------------------------------------------------------


def test_equation_9_by_hand() -> None:
    c = speed_constants([2.0, 3.0, 1.0], [1000.0, 2000.0, 0.0])
    assert c[:2] == pytest.approx([0.002, 0.0015]) and np.isnan(c[2])


def test_s_passes_through_its_points_across_a_resonance() -> None:
    found = fit_speed_influence(np.tile(resonant(STEPS), 3), np.tile(STEPS, 3))
    assert found.speeds_rpm == pytest.approx(STEPS) and (found.counts == 3).all()
    assert found.amplitude(STEPS) == pytest.approx(resonant(STEPS))
    fine = np.linspace(1000, 2000, 2001)
    assert found.amplitude(fine).max() == pytest.approx(resonant(np.array([1400.0]))[0])
    assert found.constant(fine) * fine == pytest.approx(found.amplitude(fine))


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.1, 50), min_size=2, max_size=9))
def test_s_is_monotone_between_neighbours(heights: list[float]) -> None:
    speed = 1000.0 + 150 * np.arange(len(heights))
    found = fit_speed_influence(heights, speed)
    for low, high, a, b in zip(speed, speed[1:], heights, heights[1:], strict=False):
        change = np.diff(found.amplitude(np.linspace(low, high, 40))) * np.sign(b - a)
        assert (change >= -1e-9 * max(a, b)).all()


def test_beyond_the_speeds_seen_c_is_the_nearest() -> None:
    found = fit_speed_influence([2.0, 6.0], [1000.0, 2000.0])
    assert found.amplitude([500.0, 4000.0, 0.0]) == pytest.approx([1.0, 12.0, 0.0])
    assert found.covers([990.0, 1500.0, 500.0, 4000.0]).tolist() == [True, True, False, False]


def test_one_speed_only_and_stops() -> None:
    found = fit_speed_influence([2.0, 2.2, 0.1, np.nan], [1800.0, 1801.0, 0.0, 1800.0])
    assert found.speeds_rpm.size == 1 and found.rows == 2
    assert found.amplitude(1800.5) == pytest.approx(2.1, rel=1e-3)
    with pytest.raises(TwingapError, match="running machine"):
        fit_speed_influence([1.0], [0.0])


def test_a_sweep_is_many_speeds_and_measured_steps_are_few() -> None:
    sweep = np.linspace(1000, 2000, 500)
    bands = fit_speed_influence(resonant(sweep), sweep).speeds_rpm
    assert 20 <= bands.size <= 30
    held = np.repeat(STEPS, 20) * (1 + 0.004 * np.random.default_rng(0).uniform(-1, 1, 220))
    assert fit_speed_influence(resonant(held), held).speeds_rpm == pytest.approx(STEPS, rel=0.002)


def test_equation_11_removes_speed_and_leaves_damage() -> None:
    speed = np.tile(np.concatenate((STEPS, STEPS[::-1])), 4)
    grown = np.linspace(1, 3, speed.size)
    found = fit_speed_influence(resonant(STEPS), STEPS)
    assert normalised_peak_to_peak(resonant(speed) * grown, speed, found) == pytest.approx(grown)
    assert np.isnan(normalised_peak_to_peak([1.0], [0.0], found)).all()
    with pytest.raises(TwingapError, match="one of each per row"):
        normalised_peak_to_peak([1.0, 2.0], [1000.0], found)


# -- anomaly ----------------------------------------------------------------------------------------------------------


def alarms(rule: AnomalyRule, reference: int, speeds: int, held: int, gumbel: bool) -> int:
    """Of a thousand healthy runs, normalised by constants that were learnt from their own beginning."""
    rng = np.random.default_rng(3)
    levels = np.resize(np.repeat(1000.0 * 1.1 ** np.arange(speeds), held), reference + rule.horizon_rows)
    found = 0
    for _ in range(1000):
        scatter = rng.gumbel(size=levels.size) if gumbel else rng.standard_normal(levels.size)
        p = levels * (1 + 0.05 * scatter)
        influence = fit_speed_influence(p[:reference], levels[:reference])
        assert influence.speeds_rpm.size == speeds
        c = influence.c[np.searchsorted(influence.speeds_rpm * 1.01, levels)]
        found += detect_anomaly(p / (c * levels), reference, rule, speeds=speeds).onset_row is not None
    return found


@pytest.mark.parametrize(
    ("reference", "consecutive", "speeds", "held", "lowest"),
    [(25, 3, 1, 1, 70), (60, 1, 1, 1, 70), (110, 3, 11, 10, 60), (55, 3, 11, 1, 0), (40, 2, 4, 10, 50)],
)
def test_normal_rows_alarm_at_the_stated_rate(
    reference: int, consecutive: int, speeds: int, held: int, lowest: int
) -> None:
    """With several speeds the 10 % are a bound: nearly reached where each is held, far off where they alternate."""
    rule = AnomalyRule(0.1, 220, consecutive, "normal")
    assert lowest <= alarms(rule, reference, speeds, held, False) <= 130  # above: three standard errors


@pytest.mark.parametrize("gumbel", [False, True])
@pytest.mark.parametrize(("reference", "consecutive", "speeds", "held"), [(60, 3, 1, 1), (60, 5, 1, 1), (66, 5, 11, 6)])
def test_rows_of_any_law_alarm_no_more_often_than_stated(
    reference: int, consecutive: int, speeds: int, held: int, gumbel: bool
) -> None:
    """Ranks are whole numbers, so that the rate stays below 10 % by up to a rank's worth, but not by more."""
    assert 30 <= alarms(AnomalyRule(0.1, 220, consecutive), reference, speeds, held, gumbel) <= 130


def test_the_normal_law_would_not_do_for_extremes() -> None:
    assert alarms(AnomalyRule(0.1, 220, 1, "normal"), 60, 1, 1, gumbel=True) > 300


def test_the_limits_rank_by_the_exact_mean_of_a_power() -> None:
    """E q^m of Beta(r, n - r + 1) is a ratio of factorials: one window of m rows, no later ones."""
    for n, m, share in ((40, 2, 0.05), (30, 1, 0.2), (25, 3, 0.01)):
        exact = [np.prod([(r + i) / (n + 1 + i) for i in range(m)]) for r in range(1, n // 2 + 1)]
        assert rank(n, AnomalyRule(share, m, m)) == sum(e <= share for e in exact)
    assert rank(10, AnomalyRule()) == 0
    with pytest.raises(TwingapError, match="more healthy rows"):
        detect_anomaly(np.arange(20.0), 10)


def test_a_step_is_found_where_it_is() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        x = 1 + 0.05 * rng.standard_normal(300)
        x[200:] += 0.5
        found = detect_anomaly(x, 60)
        # A healthy row just before may lie above the limit by chance, and is then counted in.
        assert found.onset_row in (198, 199, 200) and found.alarm_row == found.onset_row + 4


def test_a_knock_is_no_anomaly() -> None:
    x = 1 + 0.05 * np.random.default_rng(1).standard_normal(300)
    x[[150, 152, 154]] = 9.0
    assert detect_anomaly(x, 60).onset_row is None


def test_what_was_found_depends_on_no_later_row() -> None:
    rng = np.random.default_rng(2)
    x = 1 + 0.05 * rng.standard_normal(300)
    x[150:] *= np.exp(0.01 * np.arange(150))
    whole = detect_anomaly(x, 60)
    assert whole.alarm_row is not None
    assert detect_anomaly(x[: whole.alarm_row + 1], 60) == whole
    assert detect_anomaly(x[: whole.alarm_row], 60).onset_row is None


def test_a_stop_neither_counts_nor_breaks_the_sequence() -> None:
    x = 1 + 0.05 * np.random.default_rng(4).standard_normal(100)
    x[80], x[81], x[82], x[83], x[20] = 2.0, np.nan, 2.0, 2.0, np.nan
    found = detect_anomaly(x, 60, AnomalyRule(consecutive=3, law="normal"))
    assert (found.onset_row, found.alarm_row) == (80, 83)


def test_a_short_reference_raises_the_limit_and_too_short_is_refused() -> None:
    rule = AnomalyRule()
    numbers = [deviations(n, 1, rule) for n in (6, 12, 30, 1000)]
    assert numbers == sorted(numbers, reverse=True)
    assert deviations(10**6, 1, AnomalyRule(0.01, 1, 1)) == pytest.approx(2.3263, abs=1e-3)
    with pytest.raises(TwingapError, match="at least 15 rows"):
        detect_anomaly(np.arange(12.0), 12, speeds=11)
    with pytest.raises(TwingapError, match="equal"):
        detect_anomaly(np.ones(50), 30)
    with pytest.raises(TwingapError, match="false_alarm"):
        AnomalyRule(0.0)
