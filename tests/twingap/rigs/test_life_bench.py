"""Parts of the run-to-failure bench against references of their own: profile, growth, impact, resonance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.rigs.life_bench import FULL_SCALE_G, STEP_G, LifeBench
from twingap.rigs.spall import CONTACT_STIFFNESS, IMPACT_MASS_KG, Growth, impact
from twingap.rigs.speed_profile import SpeedProfile

BEARING = BEARINGS["6205"]
FS_HZ = 50_000.0


@pytest.fixture(scope="module")
def bench() -> LifeBench:
    return LifeBench.draw(np.random.default_rng(4), BEARING)


@pytest.mark.parametrize(
    ("shape", "period"),
    [
        ("sawtooth", [*range(1000, 2001, 100)]),
        ("triangle", [*range(1000, 2001, 100), *range(1900, 1000, -100)]),
        ("constant", [1500]),
    ],
)
def test_profile_holds_each_step_for_a_minute(shape: str, period: list[int]) -> None:
    profile = SpeedProfile(shape)
    middle = 60 * np.arange(2 * len(period)) + 30.0
    np.testing.assert_array_equal(profile.speed_rpm(middle), 2 * period)
    assert profile.speed_rpm(60.0) == period[1 % len(period)], "at a change, the new speed"
    t = np.arange(0, 1500.0)
    summed = np.concatenate([[0.0], np.cumsum(profile.speed_rpm(t) / 60)])  # steps last whole seconds
    np.testing.assert_allclose(profile.turns(np.append(t, 1500.0)), summed, rtol=1e-12)


def test_unknown_shape_is_refused() -> None:
    with pytest.raises(TwingapError, match="unknown shape 'sine'; use one of sawtooth, triangle, constant"):
        SpeedProfile("sine")


def test_a_strike_is_a_hertzian_impact() -> None:
    """Against the equation of motion m x'' = -K x^(3/2), integrated."""
    length_mm, rolling_m_s = 1.5, np.array([1.0, 1.9])
    force_n, duration_s = impact(BEARING, length_mm, rolling_m_s)
    for v, peak, lasts in zip(rolling_m_s * length_mm / BEARING.roller_diameter_mm, force_n, duration_s, strict=True):

        def motion(_: float, y: np.ndarray) -> list[float]:
            return [y[1], -CONTACT_STIFFNESS / IMPACT_MASS_KG * max(y[0], 0.0) ** 1.5]

        t = np.linspace(0, 2 * lasts, 4001)
        x = solve_ivp(motion, (0, t[-1]), [0.0, v], t_eval=t, rtol=1e-9, atol=1e-13).y[0]
        assert CONTACT_STIFFNESS * x.max() ** 1.5 == pytest.approx(peak, rel=1e-3)
        assert t[1:][x[1:] < 0][0] == pytest.approx(lasts, rel=2e-3)


def test_growth_follows_paris_within_a_stage() -> None:
    growth = Growth(1.5, 0.5, flake_turns=1.0, stage_turns=np.array([0.0, 4e4]), stage_time=np.array([0.0, 1.0]))
    turns = np.linspace(1000, 4e4, 4000)
    length = growth.length_mm(turns, 2.0)
    rate = np.gradient(length, turns)[1:-1]
    slope = np.polyfit(np.log(length[1:-1]), np.log(rate), 1)[0]
    assert slope == pytest.approx(1.5, abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_a_life_has_no_damage_before_its_onset_and_all_of_it_at_its_end(seed: int) -> None:
    growth = Growth.draw(np.random.default_rng(seed), 4e4, flake_mm=0.4)
    turns = np.linspace(-2e4, 4e4, 2001)
    length = growth.length_mm(turns, 2.2)
    assert np.all(length[turns <= 0] == 0)
    assert length[-1] == pytest.approx(2.2, rel=1e-12)
    after = turns > 0
    assert np.all(np.diff(length[after]) > 0)
    assert growth.length_mm(0.2 * 4e4, 2.2) > 0.4 * 0.97, "the first flakes are out within minutes"


def test_lives_are_not_the_exponentials_of_a_twin() -> None:
    """The best exponential in turns leaves per cents of the length, single lives excepted."""
    turns = np.linspace(0.2 * 4e4, 4e4, 500)
    left = []
    for seed in range(40):
        log_length = np.log(Growth.draw(np.random.default_rng(seed), 4e4, flake_mm=0.4).length_mm(turns, 2.2))
        left.append(np.std(log_length - np.polyval(np.polyfit(turns, log_length, 1), turns)))
    assert np.median(left) > 0.03 and np.quantile(left, 0.1) > 0.01


def test_rolling_resonates_where_its_order_meets_the_first_mode(bench: LifeBench) -> None:
    """The speed is computed here from order and mode; the bench knows only forces and modes."""
    wavy = replace(bench, roughness=0.0, background_g=0.0)
    speeds = np.arange(1000, 2001, 50.0)
    level = [
        np.std(wavy.acceleration(s, 9000.0, 0.0, 10_000, FS_HZ, np.random.default_rng(1), wear=1.0)) for s in speeds
    ]
    meets = 60 * bench.structure.frequency_hz[0] / (bench.wavy_order * BEARING.bpfo)
    assert 1050 < meets < 1950
    assert speeds[int(np.argmax(level))] == pytest.approx(meets, rel=0.04)
    assert max(level) > 2.5 * max(level[0], level[-1])


def test_faster_and_longer_is_harder(bench: LifeBench) -> None:
    def peak_to_peak(speed_rpm: float, spall_mm: float) -> float:
        seeds = range(3)
        return float(np.mean([
            np.ptp(bench.record(speed_rpm, 9000.0, spall_mm, 10_000, FS_HZ, np.random.default_rng(s), wear=1.0))
            for s in seeds
        ]))  # fmt: skip

    assert peak_to_peak(1000, 2) > peak_to_peak(1000, 1) > peak_to_peak(1000, 0)
    assert peak_to_peak(2000, 2) > 1.2 * peak_to_peak(1000, 2)
    assert peak_to_peak(2000, 0) > 1.2 * peak_to_peak(1000, 0)
    assert bench.length_for_ratio(1.4, np.random.default_rng(0)) == pytest.approx(0.6, abs=0.45)


def test_the_converter_has_steps_and_a_range(bench: LifeBench) -> None:
    x = bench.record(2000.0, 9000.0, 60.0, 5000, FS_HZ, np.random.default_rng(0), wear=1.0)
    np.testing.assert_array_equal(x / STEP_G, np.round(x / STEP_G))
    assert np.abs(x).max() == pytest.approx(FULL_SCALE_G, rel=1e-4)
    assert not np.signbit(x[x == 0]).any()
