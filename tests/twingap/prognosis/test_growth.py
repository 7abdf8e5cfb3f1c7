"""Growth laws against direct integration, and their posterior on runs that follow one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from twingap.prognosis.growth import CURVATURES, Lives, Observations, lives, remaining, shape


@pytest.mark.parametrize("q", CURVATURES)
def test_past_and_future_are_one_law(q: float) -> None:
    """d l/du = r exp(q (l - l_now)), integrated numerically, passes through both closed forms."""
    rate, far = 0.02, 1.2
    left = float(remaining(np.array(far), np.array(rate), np.array(q)))
    solved = solve_ivp(lambda _, x: rate * np.exp(q * x), (0, left), [0.0], rtol=1e-9, atol=1e-12)
    assert solved.y[0, -1] == pytest.approx(far, rel=1e-6)
    ago = 15.0
    before = float(shape(np.array([ago]), np.array(rate), np.array(q))[0])
    back = solve_ivp(lambda _, x: rate * np.exp(q * x), (0, ago), [before], rtol=1e-9, atol=1e-12)
    assert back.y[0, -1] == pytest.approx(0.0, abs=1e-6)


def test_a_law_that_had_not_begun_is_very_low_and_nothing_remains_beyond_the_end() -> None:
    # Linear growth at 0.1 of the present level per revolution began 10 revolutions ago.
    assert shape(np.array([20.0]), np.array(0.1), np.array(-1.0))[0] < -10
    assert remaining(np.array(-0.5), np.array(0.1), np.array(0.5)) == 0


def posterior(q: float, rows: int, scatter: float, end: float) -> tuple[Lives, float]:
    """A run that follows the law to half its end level, and what then truly remains."""
    rng = np.random.default_rng(3)
    u = np.arange(rows, dtype=float)
    level, since = end / 2, u[-1]
    rate = float(remaining(np.array(level), np.array(1.0), np.array(-q))) / since
    ago = u[::-1]
    x = np.maximum(level + shape(ago, np.array(rate), np.array(q)), 0.0) + scatter * rng.normal(size=rows)
    seen = Observations(ago, x, np.full(rows, scatter**2), np.ones(rows, bool), since, scatter, 1.0)
    return lives(seen, end), float(remaining(np.array(end - level), np.array(rate), np.array(q)))


@pytest.mark.parametrize("q", [-0.5, 0.0, 1.0])
def test_the_posterior_holds_the_life_of_a_run_that_follows_a_law(q: float) -> None:
    found, true = posterior(q, 200, 0.05, 3.0)
    assert found.quantile(0.02) < true < found.quantile(0.98)
    assert found.quantile(0.5) == pytest.approx(true, rel=0.5)
    assert found.level == pytest.approx(1.5, abs=0.1)


def test_a_higher_end_level_takes_longer() -> None:
    low, _ = posterior(0.0, 100, 0.1, 2.0)
    middle = low.quantile(0.5)
    rng = np.random.default_rng(3)
    u = np.arange(100.0)
    seen = Observations(
        u[::-1], 0.01 * u + 0.1 * rng.normal(size=100), np.full(100, 0.01), np.ones(100, bool), 99.0, 0.1, 1.0
    )
    first, second = (lives(seen, end).quantile(0.5) for end in (2.0, 4.0))
    assert 0 < first < second and middle > 0
    assert np.all(np.diff(low.revolutions) >= 0) and 0 < low.cumulated[0] < low.cumulated[-1] < 1 + 1e-12
