"""Laws of life: quantiles against the integral, groups of lives, loads, and independence of the unit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from twingap.prognosis.estimate import LifeOptions
from twingap.prognosis.life_law import LogNormal, Mixture, law_of, log_normal
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.outcomes import Outcome, prior_from
from twingap.prognosis.simulated_runs import simulate_run

GROUPS = [100.0, 110.0, 95.0, 900.0, 1000.0]


def test_quantiles_of_a_mixture_are_those_of_its_density() -> None:
    law = law_of(GROUPS)
    assert isinstance(law, Mixture) and law.bandwidth == 0.2

    def share(begin: float, end: float) -> float:
        return float(quad(lambda z: np.exp(law.log_density(np.array(z))), np.log(begin), np.log(end), limit=200)[0])

    for lived in (0.0, 80.0, 300.0):
        alive = share(max(lived, 1e-6), 1e8)
        for asked, left in zip((0.05, 0.5, 0.95), law.remaining(lived), strict=True):
            assert share(max(lived, 1e-6), lived + left) / alive == pytest.approx(asked, abs=0.003)


def test_groups_of_lives_narrow_what_remains() -> None:
    """Past the first group the second is expected; a single law puts the median between them."""
    law, single = law_of(GROUPS), log_normal(GROUPS)
    assert 700 < law.remaining(300.0)[1] + 300 < 1000
    assert single.remaining(300.0)[1] + 300 < 650
    assert isinstance(law_of(GROUPS[:3]), LogNormal)


@pytest.mark.parametrize("lived", [0.0, 1e2, 1e4, 1e7])
def test_there_is_a_number_after_any_life(lived: float) -> None:
    for law in (law_of(GROUPS), log_normal(GROUPS)):
        low, middle, high = law.remaining(lived)
        assert 0 < low < middle < high < np.inf
        same = np.array(type(law)(*_scaled(law, 1e3)).remaining(1e3 * lived))
        np.testing.assert_allclose(same, 1e3 * np.array((low, middle, high)), rtol=1e-6)


def _scaled(law: LogNormal | Mixture, factor: float) -> tuple[object, ...]:
    if isinstance(law, LogNormal):
        return law.mean + np.log(factor), law.std
    usual = LogNormal(law.mean + np.log(factor), law.std)
    return usual, tuple(v + float(np.log(factor)) for v in law.logs), law.bandwidth


def test_lives_are_converted_to_the_load() -> None:
    """Twice the load, an eighth of the life (ISO 281, balls); unknown loads change nothing."""
    ended = [Outcome(f"{n}", life, None, None, load_n=load) for n, life, load in ((1, 800.0, 1e3), (2, 100.0, 2e3))]
    prior = prior_from(ended, 1e3)
    assert np.exp(prior.life.mean) == pytest.approx(800.0)
    assert np.exp(prior_from(ended, 2e3).life.mean) == pytest.approx(100.0)
    assert np.exp(prior_from(ended).life.mean) == pytest.approx(np.sqrt(800.0 * 100.0))


def test_every_row_has_a_number_and_amplitude_has_no_unit() -> None:
    run = simulate_run(np.random.default_rng(3), "plateau", rows=40, varying=False)
    prior = prior_from([Outcome(f"{k}", run.revolutions[-1] * (0.6 + 0.2 * k), None, None) for k in range(5)])
    options = LifeOptions(limit_ratio=run.limit_ratio)
    one, thousand = OnlineLife(options, prior), OnlineLife(options, prior)
    for time_s, speed, height in zip(run.time_s, run.speed_rpm, run.peak_to_peak, strict=True):
        own = one.update(float(time_s), float(speed), float(height))
        other = thousand.update(float(time_s), float(speed), 1e3 * float(height))
        assert 0 <= own.revolutions_lo <= own.revolutions <= own.revolutions_hi < np.inf
        assert other.revolutions == pytest.approx(own.revolutions, rel=1e-6)
        many = np.array(one.quantiles((0.05, 0.25, 0.5, 0.75, 0.95)))
        assert (np.diff(many) >= 0).all() and many[2] == pytest.approx(own.revolutions)
