"""Quadratic surfaces: found again, their minimum, and the jackknife's known case."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.identification.surface import grid, lowest, quadratic, spread, value_at


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_a_quadratic_is_found_again(dimensions: int) -> None:
    rng = np.random.default_rng(dimensions)
    at = grid(dimensions)
    half = rng.standard_normal((dimensions, dimensions))
    hessian, bottom = half @ half.T + np.eye(dimensions), rng.uniform(-0.8, 0.8, dimensions)
    values = 3 + 0.5 * np.einsum("pi,ij,pj->p", at - bottom, hessian, at - bottom)
    assert quadratic(at, values)[2] == pytest.approx(hessian)
    assert lowest(at, values) == pytest.approx(bottom)
    assert value_at(at, values, bottom) == pytest.approx(3.0)


def test_no_minimum_where_there_is_none() -> None:
    at = grid(2)
    assert lowest(at, at[:, 0] ** 2 - at[:, 1] ** 2) is None, "a saddle"
    assert lowest(at, (at[:, 0] - 9) ** 2 + at[:, 1] ** 2) is None, "too far outside to be believed"


def test_the_jackknife_of_a_mean_is_its_standard_error() -> None:
    x = np.random.default_rng(0).standard_normal(12)
    without = np.array([np.delete(x, i).mean() for i in range(12)])[:, None]
    found = spread(without)
    assert found.variance[0] == pytest.approx(x.var(ddof=1) / 12)
    assert found.freedom[0] == 11
