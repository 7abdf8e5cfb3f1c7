"""Overall tests: exact where nothing differs, whatever the number of records, and awake where something does."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.grid import Axis
from twingap.gap.distance.paired import Paired
from twingap.gap.distance.two_sample_tests import (
    exchanges,
    mmd_kernel,
    mmd_test,
    p_value,
    two_sample_tests,
)
from twingap.records import Condition

Array = NDArray[np.float64]
BINS = 30


def pair_of(n: int, m: int, rng: np.random.Generator, shift: Array | float = 0.0, bins: int = BINS) -> Paired:
    edges = np.arange(bins + 1.0)
    axes: dict[DomainName, Axis] = {"order": Axis(edges[:-1], edges[1:], ("lines",) * bins, "shaft orders")}
    conditions = tuple(Condition(f"r{i}", 1500 + 20 * i, 12000, 600, ("healthy", "outer")[i % 2]) for i in range(n))
    common = rng.standard_normal((n, bins)) * 3  # what the condition does to records and replicates alike

    def draw(by: Array | float) -> FeatureVectors:
        return FeatureVectors({"order": common + by + rng.standard_normal((n, bins))}, axes, conditions)

    return Paired(draw(shift), [draw(0.0) for _ in range(m)])


@pytest.mark.parametrize(("n", "m"), [(1, 19), (2, 20), (8, 3), (12, 1)])
def test_false_alarms_are_five_per_cent(n: int, m: int) -> None:
    rng = np.random.default_rng(n)
    worlds = 100
    p = np.array([[t.p_value for t in two_sample_tests(pair_of(n, m, rng), rng, 79)] for _ in range(worlds)])
    assert np.all((p <= 0.05).sum(axis=0) <= binom.ppf(0.999, worlds, 0.05))


@pytest.mark.parametrize(("n", "m"), [(2, 20), (16, 5), (16, 1)])
def test_a_broad_difference_is_found(n: int, m: int) -> None:
    rng = np.random.default_rng(3)
    for result in two_sample_tests(pair_of(n, m, rng, 1.5), rng, 199):
        assert result.p_value <= 0.02


def test_one_bin_of_many_is_found() -> None:
    rng = np.random.default_rng(4)
    shift = np.zeros(200)
    shift[70] = 5.0
    pair = pair_of(16, 10, rng, shift, 200)
    auc, mmd = two_sample_tests(pair, rng, 199)
    assert auc.p_value <= 0.02 and auc.statistic > 0.75
    assert mmd.p_value <= 0.02


def test_a_difference_of_opposite_signs_in_two_faults_is_found() -> None:
    rng = np.random.default_rng(9)
    sign = np.where(np.arange(16) % 2 == 0, 1.5, -1.5)[:, None]
    for result in two_sample_tests(pair_of(16, 10, rng, sign), rng, 199):
        assert result.p_value <= 0.02 or result.name.startswith("MMD")


def test_auc_is_a_half_and_mmd_is_zero_on_average_where_nothing_differs() -> None:
    rng = np.random.default_rng(5)
    statistics = np.array([[t.statistic for t in two_sample_tests(pair_of(6, 4, rng), rng, 1)] for _ in range(150)])
    error = statistics.std(axis=0) / np.sqrt(150)
    assert np.all(np.abs(statistics.mean(axis=0) - [0.5, 0.0]) < 4 * error)


def test_mmd_agrees_with_its_kernel_of_records() -> None:
    rng = np.random.default_rng(6)
    pair = pair_of(5, 3, rng, 1.0)
    h, groups = mmd_kernel(pair, rng)
    off = (h.sum() - np.trace(h)) / 20
    assert mmd_test(pair, rng, 1)[0].statistic == pytest.approx(off)
    assert groups == [c.name for c in pair.conditions]


def test_the_first_exchange_is_the_observed_one() -> None:
    choices = exchanges(4, 5, 50, np.random.default_rng(7))
    assert choices.shape == (51, 4) and not choices[0].any() and set(np.unique(choices)) == set(range(6))
    assert p_value(np.array([2.0, 1.0, 3.0, 0.0])) == 0.5
