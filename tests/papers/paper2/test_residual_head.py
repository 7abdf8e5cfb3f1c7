"""The head on a trained network: it follows labels near by, leaves the network alone far off, and is the same twice."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import softmax

from papers.paper2_digital_twin.methods.residual_head import HeadOptions, fit_residual_head

Array = NDArray[np.float64]
CENTRES = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 6.0]])


def clouds(rng: np.random.Generator, per: int) -> tuple[Array, NDArray[np.int64]]:
    labels = np.repeat(np.arange(3), per)
    return CENTRES[labels] + 0.4 * rng.standard_normal((3 * per, 2)), labels


def sure_of(classes: NDArray[np.int64], by: float = 4.0) -> Array:
    return by * np.eye(3)[classes]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.mark.parametrize("per", [1, 10])
def test_what_the_network_gets_wrong_with_certainty_is_unlearnt_from_few_labels(
    rng: np.random.Generator, per: int
) -> None:
    """The network takes every record of class 2 for class 1, as it takes CWRU's ball of 21 mil for an inner race."""
    taken_for = np.array([0, 1, 1])
    x, y = clouds(rng, per)
    new, wanted = clouds(rng, 50)
    head = fit_residual_head(sure_of(taken_for[y]), x, y, new)
    told = head.probabilities(sure_of(taken_for[wanted]), new)
    assert (told.argmax(axis=1) == wanted).mean() > 0.95
    np.testing.assert_allclose(told.sum(axis=1), 1)


def test_far_from_all_labels_the_network_is_left_as_it_is(rng: np.random.Generator) -> None:
    x, y = clouds(rng, 10)
    logits = rng.standard_normal((20, 3))
    options = HeadOptions(trust=0.7)
    head = fit_residual_head(sure_of((y + 1) % 3), x, y, x, options)
    np.testing.assert_allclose(head.probabilities(logits, np.full((20, 2), 1e3)), softmax(0.7 * logits, axis=1))
    without = fit_residual_head(sure_of((y + 1) % 3), x, y, x, HeadOptions(trust=0.0))
    np.testing.assert_allclose(without.probabilities(logits, np.full((20, 2), 1e3)), 1 / 3)


def test_where_the_network_is_right_little_changes(rng: np.random.Generator) -> None:
    x, y = clouds(rng, 10)
    right, wrong = (fit_residual_head(sure_of(c), x, y, x) for c in (y, (y + 1) % 3))
    assert np.abs(right.weights).max() < 0.5 * np.abs(wrong.weights).max()


def test_each_class_weighs_alike_however_many_records_it_has(rng: np.random.Generator) -> None:
    """Two classes in one place: a hundred records of one do not outvote ten of the other."""
    x = np.concatenate((0.1 * rng.standard_normal((110, 2)), CENTRES[2] + 0.1 * rng.standard_normal((10, 2))))
    y = np.repeat([0, 1, 2], [100, 10, 10])
    head = fit_residual_head(np.zeros((120, 3)), x, y, clouds(rng, 50)[0])
    told = head.probabilities(np.zeros((1, 3)), np.zeros((1, 2)))
    assert told[0, 0] == pytest.approx(told[0, 1], rel=0.1)
    assert told[0, 2] < 0.2


def test_the_posterior_is_at_its_maximum_and_the_same_twice(rng: np.random.Generator) -> None:
    """At the maximum the weights are the residuals that they cause: K^-1 g = w (t - p), g = K weights."""
    x, y = clouds(rng, 4)
    logits = rng.standard_normal((12, 3))
    options = HeadOptions(length=0.8, variance=5.0, trust=1.0)
    head = fit_residual_head(logits, x, y, x, options)
    told = head.probabilities(logits, x)
    np.testing.assert_allclose(head.weights, np.eye(3)[y] - told, atol=2e-3)
    assert (fit_residual_head(logits, x, y, x, options).weights == head.weights).all()


def test_features_are_scaled_by_the_reference_and_labels_of_it_do_not_matter(rng: np.random.Generator) -> None:
    x, y = clouds(rng, 5)
    new = clouds(rng, 20)[0]
    size = np.array([1e-5, 1e4])
    plain = fit_residual_head(np.zeros((15, 3)), x, y, new).probabilities(np.zeros((60, 3)), new)
    scaled = fit_residual_head(np.zeros((15, 3)), x * size, y, new * size).probabilities(np.zeros((60, 3)), new * size)
    np.testing.assert_allclose(plain, scaled, atol=1e-5)
    level = np.concatenate((x, np.ones((15, 1))), axis=1)  # a feature that says nothing is no reason to fail
    assert np.isfinite(fit_residual_head(np.zeros((15, 3)), level, y, level).weights).all()
