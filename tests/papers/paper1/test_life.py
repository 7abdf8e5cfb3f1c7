"""Damage and remaining life against known curves and direct integration; encodings; the healthy mode; record length."""

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from papers.paper1_rul_varying_speed.methods.architecture import critical_length, positional_encoding, speed_position
from papers.paper1_rul_varying_speed.methods.degradation import DamageFit, damage, end_row, fit_damage, trajectories
from papers.paper1_rul_varying_speed.methods.run import remaining_revolutions, remaining_time_s
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.identification import equation_8, spectra
from twingap.prognosis import SpeedInfluence, fit_speed_influence
from twingap.records import Condition
from twingap.twins import PhenomenologicalParameters, PhenomenologicalTwin

STEPS = np.arange(1000.0, 2001.0, 100.0)
PROFILE = np.tile(np.repeat(np.concatenate((STEPS, STEPS[-2:0:-1])), 6), 12)
"""10 s rows, 60 s a step, up and down between 1000 and 2000 rpm: 4 hours."""


def rising() -> SpeedInfluence:
    return fit_speed_influence(STEPS / 1000, STEPS)


# -- remaining life ---------------------------------------------------------------------------------------------------


def test_slope_is_minus_one_at_constant_speed() -> None:
    left = remaining_revolutions(np.full(50, 1500.0), 10.0)
    assert np.diff(remaining_time_s(left, 1500.0)) == pytest.approx(-10.0)
    varying = np.repeat([1000.0, 2000.0, 1200.0], 20)
    time = remaining_time_s(remaining_revolutions(varying, 10.0), varying)
    steps = np.diff(time).reshape(-1)
    assert np.delete(steps, [19, 39]) == pytest.approx(-10.0)
    # Twice the speed, about half the time: the prediction reacts to speed.
    assert time[20] == pytest.approx((time[19] - 20) / 2)


def test_equation_14_by_hand() -> None:
    assert remaining_revolutions([60.0, 120.0, 180.0], 1.0) == pytest.approx([5, 3, 0])


def test_a_machine_at_rest_lasts_for_ever() -> None:
    assert np.isinf(remaining_time_s(3.0, 0.0)) and remaining_time_s(0.0, 0.0) == 0
    with pytest.raises(TwingapError, match="per row"):
        remaining_revolutions([60.0, np.nan], 1.0)


# -- damage -----------------------------------------------------------------------------------------------------------


def test_equation_12_by_hand() -> None:
    assert damage([0, 10, 12], 0.5, 10) == pytest.approx([1, 1, np.e])
    assert np.isfinite(damage(1e9, 1.0, 0.0))


@pytest.mark.parametrize("level", ["one", "free"])
def test_a_known_curve_is_recovered(level: Literal["one", "free"]) -> None:
    k = np.arange(100, 160)
    jump = 1.0 if level == "one" else 1.7
    fit = fit_damage(k, jump * damage(k, 0.02, 99), 99, level=level)
    assert fit.rate == pytest.approx(0.02) and fit.level == pytest.approx(jump)
    assert fit.damage(k) == pytest.approx(jump * damage(k, 0.02, 99))


@pytest.mark.parametrize("level", ["one", "free"])
def test_the_rate_lies_within_its_error_as_often_as_it_should(level: Literal["one", "free"]) -> None:
    rng = np.random.default_rng(0)
    k = np.arange(0, 61)
    seen = [damage(k, 0.01, 0) * np.exp(0.1 * rng.standard_normal(61)) for _ in range(400)]
    fits = [fit_damage(k, x, 0, level=level) for x in seen]
    inside = np.mean([abs(f.rate - 0.01) < 1.645 * f.rate_error for f in fits])
    assert 0.85 < inside < 0.95


def test_rows_before_the_onset_and_stops_do_not_count() -> None:
    k = np.arange(40)
    x = damage(k, 0.05, 10)
    x[:10] = 7.0
    x[20] = np.nan
    assert fit_damage(k, x, 10) == fit_damage(k[10:], x[10:], 10)
    with pytest.raises(TwingapError, match="wait for more"):
        fit_damage(k[:11], x[:11], 10)


# -- trajectories -----------------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(rate=st.floats(0.004, 0.03), count=st.integers(1, 8), span_min=st.floats(1, 60), seen=st.integers(0, 30))
def test_lives_end_at_the_limit_and_within_the_range(rate: float, count: int, span_min: float, seen: int) -> None:
    fit, influence = DamageFit(rate, 0.0, 500.0, 1.0, 60), rising()
    lives = trajectories(
        fit, influence, PROFILE, 10.0, 15.0, count=count, simulation_range_s=60 * span_min, not_before_row=500 + seen
    )
    ends = np.array([life.end_row for life in lives])
    assert len(lives) == count and (np.diff(ends) >= 0).all() and (ends > 500 + seen).all()
    assert (ends[-1] - ends[0]) * 10 <= 60 * span_min
    assert len({life.rate for life in lives}) == count
    central = end_row(influence.amplitude(PROFILE) * damage(np.arange(PROFILE.size), rate, 0), 15.0)
    assert central is not None and (np.abs(ends - 500 - central) * 10 <= 30 * span_min + 1e-6).all()
    for life in lives:
        p = life.peak_to_peak
        assert p == pytest.approx(PROFILE[: p.size] / 1000 * np.exp(life.rate * np.arange(p.size)))
        assert end_row(p, 15.0 * (1 - 1e-9)) == p.size - 1
        assert life.remaining_revolutions[-1] == 0 and life.positions[0] == 0
        assert life.remaining_revolutions[0] == pytest.approx(np.sum(PROFILE[1 : p.size]) / 6)


def test_at_constant_speed_ends_fill_the_range_evenly() -> None:
    influence = fit_speed_influence([1.0], [1500.0])
    lives = trajectories(DamageFit(0.01, 0.0, 0.0, 1.0, 60), influence, np.full(600, 1500.0), 10.0, 15.0)
    ends = np.array([life.end_row for life in lives])
    # ln 15 / 0.01 = 270.8 rows: 271, and 120 rows on either side.
    assert ends == pytest.approx(np.linspace(151, 391, 6), abs=1)


def test_lives_that_cannot_be_are_refused() -> None:
    influence, fit = rising(), DamageFit(0.01, 0.0, 0.0, 1.0, 60)
    with pytest.raises(TwingapError, match="no growth"):
        trajectories(DamageFit(-0.01, 0.0, 0.0, 1.0, 60), influence, PROFILE, 10.0, 15.0)
    with pytest.raises(TwingapError, match="longer profile"):
        trajectories(fit, influence, PROFILE[:50], 10.0, 15.0)
    with pytest.raises(TwingapError, match="raise the limit"):
        trajectories(fit, influence, PROFILE, 10.0, 1.5)
    with pytest.raises(TwingapError, match="lives on"):
        trajectories(fit, influence, PROFILE, 10.0, 15.0, not_before_row=1000)
    assert end_row([1.0, 2.0], 3.0) is None


# -- encodings --------------------------------------------------------------------------------------------------------


def test_encodings_by_the_formula_and_all_distinct() -> None:
    code = positional_encoding(np.arange(1, 2001))
    assert code.shape == (2000, 24) and positional_encoding(np.ones((2, 3)), 6).shape == (2, 3, 6)
    for pos, i in ((1, 0), (7, 5), (1999, 11)):
        assert code[pos - 1, 2 * i] == pytest.approx(np.sin(pos / 10000 ** (2 * i / 24)))
        assert code[pos - 1, 2 * i + 1] == pytest.approx(np.cos(pos / 10000 ** (2 * i / 24)))
    # Not neighbours only: 500 positions pairwise.
    apart = np.linalg.norm(code[:500, None] - code[None, :500], axis=2) + 9 * np.eye(500)
    assert apart.min() > 0.3
    with pytest.raises(TwingapError, match="even"):
        positional_encoding(1, 5)


def test_positions_of_speeds() -> None:
    assert speed_position([1000, 2000, 1149, 1151, 900, 3000], STEPS).tolist() == [1, 11, 2, 3, 1, 11]
    assert speed_position(7.0, [1500.0]) == 1
    with pytest.raises(TwingapError, match="increasing"):
        speed_position(1.0, [2.0, 1.0])


# -- the healthy mode, and the record's length -----------------------------------------------------------------------


def test_the_mode_of_healthy_records_at_several_speeds() -> None:
    own = PhenomenologicalParameters(4000.0, 0.04, structure_noise_rms=0.9, white_noise_rms=np.sqrt(1 - 0.81))
    conditions = [Condition(f"r{i}", 1000.0 + 100 * i, 25600.0, 12800, "healthy") for i in range(6)]
    made = PhenomenologicalTwin(BEARINGS["6205"], own).simulate(conditions, np.random.default_rng(1))
    fit = equation_8(spectra(made))
    assert fit.resonance_hz == pytest.approx(4000, rel=0.03) and fit.damping_ratio == pytest.approx(0.04, rel=0.35)


def test_equation_16_covers_its_impacts_and_not_one_sample_more() -> None:
    bearing = BEARINGS["6205"]
    spin_hz = bearing.bsf * 1000 / 60
    for impacts in (1, 20):
        n = critical_length(bearing, 1000.0, 50000.0, impacts)
        assert (n - 1) / 50000 * spin_hz < impacts <= n / 50000 * spin_hz
    # The paper's 25,000 samples: 19.6 strokes.
    assert critical_length(bearing, 1000.0, 50000.0, 19) < 25000 < critical_length(bearing, 1000.0, 50000.0, 20)
    with pytest.raises(TwingapError, match="above 0"):
        critical_length(bearing, 0.0, 50000.0)
