"""Prevalence of effects in fleets: probabilities given all machines are calibrated, and sharper than by themselves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from twingap.effects import trainable
from twingap.fleet.prevalence import STRENGTH, prevalence, training_prevalence

TRAINED = 0.08
Array = NDArray[np.float64]


def fleet(size: int, part: float, rng: np.random.Generator, separation: float = 1.5) -> tuple[NDArray[np.bool_], Array]:
    """Which machines have an effect, and their probabilities by themselves, calibrated for `TRAINED`."""
    has = rng.random(size) < part
    score = rng.normal(np.where(has, separation, 0.0))
    odds = np.exp(separation * score - separation**2 / 2) * TRAINED / (1 - TRAINED)
    return has, odds / (1 + odds)


def with_prevalence(own: Array, part: float) -> Array:
    """Probabilities where a part of the machines has the effect that is known."""
    odds = own / (1 - own) * (1 - TRAINED) / TRAINED * part / (1 - part)
    return np.asarray(odds / (1 + odds))


def log_loss(has: NDArray[np.bool_], p: Array) -> float:
    return -float(np.log(np.where(has, p, 1 - p)).mean())


@pytest.mark.parametrize("size", [3, 10, 40])
def test_with_the_fleet_they_are_calibrated_and_sharper(size: int) -> None:
    rng = np.random.default_rng(size)
    has, own, given, covered = [], [], [], 0
    for _ in range(400):
        part = rng.beta(STRENGTH * TRAINED, STRENGTH * (1 - TRAINED))
        now, p = fleet(size, part, rng)
        found = prevalence(p, TRAINED)
        covered += found.ci[0] <= part <= found.ci[1]
        has.append(now)
        own.append(p)
        given.append(found.probability)
    truth, alone, together = np.concatenate(has), np.concatenate(own), np.concatenate(given)
    assert log_loss(truth, together) < log_loss(truth, alone)
    assert covered / 400 > 0.85
    # Calibrated: within bins of the probability, the part of the machines that have the effect.
    for low in np.arange(0, 1, 0.25):
        inside = (together >= low) & (together < low + 0.25)
        error = np.sqrt(0.25 / max(inside.sum() / size, 1))  # machines of a fleet are not independent
        assert truth[inside].mean() == pytest.approx(together[inside].mean(), abs=3 * error)
    assert together.mean() == pytest.approx(truth.mean(), abs=0.03)


def test_a_frequent_effect_becomes_more_probable_and_a_rare_one_less() -> None:
    rng = np.random.default_rng(1)
    has, own = fleet(30, 0.8, rng)
    assert log_loss(has, prevalence(own, TRAINED).probability) < 0.6 * log_loss(has, own)
    absent = np.append(np.full(29, 0.002), 0.3)
    assert prevalence(absent, TRAINED).probability[-1] < 0.15


@pytest.mark.parametrize("p", [0.01, 0.4, 0.97])
def test_a_single_machine_is_as_it_is(p: float) -> None:
    assert prevalence([p], TRAINED).probability == pytest.approx([p], rel=1e-4)


def test_in_a_large_fleet_it_is_what_em_finds() -> None:
    _, own = fleet(3000, 0.3, np.random.default_rng(2))
    part = TRAINED
    for _ in range(500):
        part = with_prevalence(np.clip(own, 0.01, 0.99), part).mean()
    found = prevalence(own, TRAINED)
    assert found.mean == pytest.approx(part, abs=0.005)
    np.testing.assert_allclose(found.probability, with_prevalence(own, part), atol=0.01)


def test_order_and_certain_machines_do_no_harm() -> None:
    own = np.array([0.0, 1.0, 0.2, 1.0])
    found, back = prevalence(own, TRAINED), prevalence(own[::-1], TRAINED)
    np.testing.assert_allclose(found.probability, back.probability[::-1], rtol=1e-12)
    assert np.isfinite(found.probability).all() and 0 <= found.ci[0] < found.mean < found.ci[1] <= 1


def test_every_effect_that_is_trained_has_a_prevalence_in_training() -> None:
    trained = training_prevalence()
    assert trained.keys() == trainable().keys()
    assert all(0 < p < 0.5 for p in trained.values())
