"""SOM-MQE: against distances computed otherwise, and false alarms counted."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from papers.paper2_digital_twin.methods.severity import (
    MapOptions,
    conformal_threshold,
    fit_map,
    healthy_map,
    scaling_of,
)
from twingap.errors import TwingapError


def healthy(n: int, rng: np.random.Generator) -> np.ndarray:
    """Correlated, skewed features of very different size."""
    z = rng.standard_normal((n, 5))
    z[:, 1] += 0.8 * z[:, 0]
    return np.exp(0.3 * z) * np.array([1e-3, 1.0, 1e3, 1.0, 5.0])


def test_mqe_is_the_distance_to_the_nearest_of_minisoms_weights() -> None:
    from minisom import MiniSom

    rng = np.random.default_rng(0)
    x = healthy(300, rng)
    found = fit_map(x, MapOptions(side=5, epochs=3), np.random.default_rng(1))
    # The same map, made by hand.
    scaled = (x - x.mean(axis=0)) / x.std(axis=0)
    seed = int(np.random.default_rng(1).integers(2**31))
    net = MiniSom(5, 5, 5, sigma=5 / 3, learning_rate=0.5, random_seed=seed)
    net.pca_weights_init(scaled)
    net.train(scaled, 3 * 300, random_order=True)
    new = healthy(50, rng) * 1.7
    wanted = cdist((new - x.mean(axis=0)) / x.std(axis=0), net.get_weights().reshape(25, 5)).min(axis=1)
    assert found.mqe(new) == pytest.approx(wanted, rel=1e-9)
    # MiniSom's own number, a mean over windows.
    assert found.mqe(x).mean() == pytest.approx(net.quantization_error(scaled), rel=1e-9)


def test_mqe_is_nought_on_a_unit_and_grows_away_from_the_map() -> None:
    rng = np.random.default_rng(2)
    found = fit_map(healthy(200, rng), MapOptions(), rng)
    on_units = found.weights * found.spread + found.centre
    assert found.mqe(on_units) == pytest.approx(0, abs=1e-6)
    edge = found.centre + 50 * found.spread
    farther = found.centre + 60 * found.spread
    assert found.mqe(farther)[0] > found.mqe(edge)[0] > 10


def test_the_stated_share_of_healthy_windows_alarms() -> None:
    """P(alarm) = 1 - k / (n + 1) exactly, over draws of calibration and test: 0.01 for n = 199."""
    rng = np.random.default_rng(3)
    trials = 4000
    scores = rng.lognormal(size=(trials, 199))
    limits = np.array([conformal_threshold(s, 0.01) for s in scores])
    rate = float(np.mean(rng.lognormal(size=(trials, 25)) > limits[:, None]))
    # One threshold is shared by 25 tests: sd of the rate within a threshold is about 0.007, so sd of the mean 1.2e-4.
    assert rate == pytest.approx(0.01, abs=6e-4)


def test_a_whole_map_keeps_its_false_alarm_rate_and_sees_a_fault() -> None:
    rng = np.random.default_rng(4)
    rates, seen = [], []
    for _ in range(12):
        own = healthy_map(healthy(120, rng), np.repeat(["a", "b", "c"], 40), 0.05, rng, MapOptions(side=4, epochs=4))
        rates.append(np.mean(own.mqe(healthy(300, rng)) > own.threshold))
        seen.append(np.mean(own.mqe(healthy(30, rng) * np.array([3.0, 1, 1, 3.0, 1])) > own.threshold) > 0.5)
    assert np.mean(rates) < 0.07
    assert all(seen)


def test_a_group_held_out_is_not_seen_by_its_map() -> None:
    """A recording unlike the others must have scores that say so, though the final map covers it."""
    rng = np.random.default_rng(5)
    x = np.concatenate((healthy(60, rng), healthy(60, rng), healthy(60, rng) * 4))
    own = healthy_map(x, np.repeat(["a", "b", "odd"], 60), 0.01, rng)
    odd = own.held_out[120:]
    assert odd.min() > 3 * own.held_out[:120].mean() or odd.mean() > 3 * own.mqe(x[120:]).mean()
    assert own.threshold > np.median(odd)


def test_same_seed_same_map_and_small_sets_get_small_grids() -> None:
    x = healthy(40, np.random.default_rng(6))
    maps = [fit_map(x, MapOptions(), np.random.default_rng(7)) for _ in range(2)]
    assert (maps[0].weights == maps[1].weights).all()
    assert len(fit_map(x[:10], MapOptions(), np.random.default_rng(0)).weights) == 9
    one = fit_map(x[:1], MapOptions(), np.random.default_rng(0), scaling=scaling_of(x))
    assert one.mqe(x[:1])[0] == pytest.approx(0, abs=1e-9)
    assert one.mqe(x[1:2])[0] == pytest.approx(np.linalg.norm((x[1] - x[0]) / x.std(axis=0)))


@pytest.mark.parametrize(("rate", "needed"), [(0.01, 99), (0.05, 19), (0.001, 999)])
def test_too_few_windows_for_the_rate_are_refused_in_one_line(rate: float, needed: int) -> None:
    scores = np.arange(float(needed))
    assert conformal_threshold(scores, rate) == needed - 1
    with pytest.raises(TwingapError, match=f"needs {needed}"):
        conformal_threshold(scores[1:], rate)
