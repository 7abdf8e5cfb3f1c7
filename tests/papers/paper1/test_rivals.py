"""Rival estimators: right on their own law, and causal."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from papers.extra.femto import rivals

Array = NDArray[np.float64]


def growth(rows: int = 200, scatter: float = 0.05, rate: float = 0.01) -> rivals.Growth:
    """Exponential growth that ends at 3, 300 revolutions after the onset."""
    rng = np.random.default_rng(0)
    u = np.arange(rows, dtype=float)
    return rivals.Growth(u, rate * u + scatter * rng.normal(size=rows), scatter, 10, 3.0, 250.0)


def test_both_find_the_end_of_exponential_growth() -> None:
    given = growth()
    fitted = rivals.exponential_extrapolation(given)
    middle, low, high = rivals.particle_filter(given, np.random.default_rng(1))
    assert np.isnan(fitted[:10]).all() and np.isnan(middle[:10]).all() and np.isfinite(fitted[10:]).all()
    assert fitted[-1] == pytest.approx(101.0, rel=0.03)
    assert middle[-1] == pytest.approx(101.0, rel=0.35) and low[-1] < 101.0 < high[-1]


def test_without_growth_the_usual_life_is_left() -> None:
    given = growth(rate=-0.01)
    assert rivals.exponential_extrapolation(given)[-1] == pytest.approx(250.0 - 199.0)


def test_rows_depend_on_no_later_ones() -> None:
    given = growth()
    cut = dataclasses.replace(given, revolutions=given.revolutions[:120], log_amplitude=given.log_amplitude[:120])
    np.testing.assert_array_equal(rivals.exponential_extrapolation(given)[:120], rivals.exponential_extrapolation(cut))
    for whole, part in zip(
        rivals.particle_filter(given, np.random.default_rng(2)), rivals.particle_filter(cut, np.random.default_rng(2)),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_array_equal(whole[:120], part)
    rng = np.random.default_rng(3)
    x, u = np.exp(rng.normal(size=(150, 2))), np.arange(150.0)
    features = rivals.causal_features(x, u)
    np.testing.assert_array_equal(features[:90], rivals.causal_features(x[:90], u[:90]))
    assert features.shape == (150, 9) and np.isfinite(features).all()


def test_the_forest_learns_what_other_runs_show() -> None:
    rng = np.random.default_rng(4)

    def run(rows: int) -> tuple[Array, Array]:
        left = np.arange(rows)[::-1].astype(float)
        return np.column_stack((-left + rng.normal(size=rows), rng.normal(size=rows))), left

    features, left = run(120)
    middle, low, high = rivals.random_forest([run(150), run(130)], features, seed=0, trees=40)
    assert np.sqrt(np.mean((middle - left) ** 2)) < 12
    assert np.mean((low <= left) & (left <= high)) > 0.5
    again = rivals.random_forest([(features, left)], features, seed=1, trees=5)[0]
    np.testing.assert_array_equal(again, rivals.random_forest([(features, left)], features, seed=1, trees=5)[0])
