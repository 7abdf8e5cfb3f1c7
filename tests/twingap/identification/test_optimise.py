"""Optimisers: the zebra's steps against a hand computation, equal evaluations, same seed same answer."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.errors import TwingapError
from twingap.identification.optimise import OPTIMISERS, Array, Traced, optimiser_of
from twingap.identification.zebra import Zebra, flee, forage, whole

BOX = np.array([[18.0, 26.0], [3.0, 8.0]])


def bowl(points: Array) -> Array:
    """Least at (23, 6), with a hole in it where nothing can be simulated."""
    values = np.sum((points - [23.0, 6.0]) ** 2, axis=1)
    return np.where(points[:, 0] > 25.5, np.inf, values)


def test_the_steps_of_a_zebra_by_hand() -> None:
    x = np.array([[2.0, 10.0], [4.0, -8.0]])
    # x + r (PZ - I x): 2 + 0.5 (6 - 2) = 4, 10 + 0.25 (6 - 10) = 9; with I = 2: 4 + 1 (6 - 8) = 2, -8 + 0 = -8.
    moved = forage(x, np.array([6.0, 6.0]), np.array([[0.5, 0.25], [1.0, 0.0]]), np.array([1.0, 2.0]))
    assert moved.tolist() == [[4.0, 9.0], [2.0, -8.0]]
    # x + R (2 r - 1) (1 - t / T) x with R = 0.1, t / T = 1/2: factors 1 + 0.05 (1, -1), 1 + 0.05 (0, 0.5).
    moved = flee(x, 0.1, 0.5, np.array([[1.0, 0.0], [0.5, 0.75]]))
    assert moved == pytest.approx(np.array([[2.1, 9.5], [4.0, -8.2]]))
    assert np.array_equal(flee(x, 0.1, 1.0, np.ones((2, 2))), x), "at the last iteration nobody flees"


def test_i_is_one_or_two_with_even_chances() -> None:
    drawn = whole(np.random.default_rng(0), 4000)
    assert set(drawn) == {1.0, 2.0} and drawn.mean() == pytest.approx(1.5, abs=0.03)


def test_a_herd_step_by_step() -> None:
    """The authors' loop over single zebras, written out, tries the same points in the same order."""
    tried: list[Array] = []

    def watched(points: Array) -> Array:
        tried.extend(points.copy())
        return bowl(points)

    Zebra(reach=0.01, herd=4)(watched, BOX, np.random.default_rng(3), 4 + 2 * 4 * 5)
    rng, low, high, expected = np.random.default_rng(3), BOX[:, 0], BOX[:, 1], []
    x = low + (high - low) * rng.random((4, 2))
    cost = bowl(x)
    expected.extend(x.copy())
    for t in range(1, 6):
        pioneer = x[np.argmin(cost)].copy()
        for phase in (1, 2):
            hunted = phase == 2 and rng.random() < 0.5
            target = pioneer if phase == 1 else x[rng.integers(4)].copy() if not hunted else pioneer
            r = rng.random((4, 2))
            i = np.ones(4) if hunted else rng.integers(1, 3, 4)
            for zebra in range(4):
                if hunted:
                    new = x[zebra] * (1 + 0.01 * (2 * r[zebra] - 1) * (1 - t / 5))
                else:
                    new = x[zebra] + r[zebra] * (target - i[zebra] * x[zebra])
                new = np.minimum(np.maximum(new, low), high)
                expected.append(new)
                value = bowl(new[None])[0]
                if value <= cost[zebra]:
                    x[zebra], cost[zebra] = new, value
    assert np.allclose(tried, expected, rtol=1e-13)


@pytest.mark.parametrize("name", OPTIMISERS)
@pytest.mark.parametrize("evaluations", [1, 16, 100, 336])
def test_just_so_many_evaluations_within_the_box(name: str, evaluations: int) -> None:
    traced = Traced(bowl)
    best = OPTIMISERS[name](traced, BOX, np.random.default_rng(0), evaluations)
    assert len(traced.values) == evaluations
    assert np.all((traced.points >= BOX[:, 0] - 1e-12) & (traced.points <= BOX[:, 1] + 1e-12))
    assert bowl(best[None])[0] == traced.best[-1], "what is handed back is the best that was tried"
    assert np.all(np.diff(traced.best[np.isfinite(traced.best)]) <= 0)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_the_same_seed_gives_the_same_points(name: str) -> None:
    def points(seed: int) -> Array:
        traced = Traced(bowl)
        OPTIMISERS[name](traced, BOX, np.random.default_rng(seed), 112)
        return traced.points

    assert np.array_equal(points(5), points(5))
    assert not np.array_equal(points(5), points(6))


@pytest.mark.parametrize("name", OPTIMISERS)
def test_the_bottom_of_a_bowl_with_a_hole(name: str) -> None:
    best = OPTIMISERS[name](bowl, BOX, np.random.default_rng(1), 336)
    assert bowl(best[None])[0] < (0.3 if name == "random" else 0.05)


def test_a_box_of_one_dimension() -> None:
    for optimiser in OPTIMISERS.values():
        best = optimiser(lambda points: (points[:, 0] - 4.0) ** 2, BOX[1:], np.random.default_rng(0), 112)
        assert best == pytest.approx([4.0], abs=0.2)


def test_an_unknown_optimiser() -> None:
    with pytest.raises(TwingapError, match=r"unknown optimiser 'zebra'.*use zoa, zoa-ports, differential-evolution"):
        optimiser_of("zebra")
