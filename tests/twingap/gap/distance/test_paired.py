"""Distances: nothing on average between two sets of one machine, the truth on average between two machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.grid import Axis
from twingap.gap.distance.paired import Paired, compressed
from twingap.records import Condition

Array = NDArray[np.float64]
BINS = 40


def conditions_of(n: int, faults: Sequence[str] = ("healthy", "outer"), per_group: int = 1) -> tuple[Condition, ...]:
    return tuple(
        Condition(f"r{i}", 1500 + 20 * i, 12000, 600, faults[i % len(faults)], group=f"g{i // per_group}")
        for i in range(n)
    )


def vectors_of(conditions: Sequence[Condition], rng: np.random.Generator, shift: Array | float = 0.0) -> FeatureVectors:
    edges = np.arange(BINS + 1.0)
    axes: dict[DomainName, Axis] = {"order": Axis(edges[:-1], edges[1:], ("lines",) * BINS, "shaft orders")}
    return FeatureVectors({"order": rng.standard_normal((len(conditions), BINS)) + shift}, axes, tuple(conditions))


def pair_of(n: int, m: int, rng: np.random.Generator, shift: Array | float = 0.0) -> Paired:
    conditions = conditions_of(n)
    return Paired(vectors_of(conditions, rng, shift), [vectors_of(conditions, rng) for _ in range(m)])


def overall_of(pair: Paired) -> float:
    return float(pair.over_domains(pair.squares())[0][0])


@pytest.mark.parametrize(("n", "m"), [(1, 10), (2, 10), (24, 5)])
def test_squares_are_unbiased_with_and_without_a_gap(n: int, m: int) -> None:
    rng = np.random.default_rng(1)
    shift = np.where(np.arange(BINS) < 10, 2.0, 0.0)
    means = []
    for _ in range(150):
        pair = pair_of(n, m, rng, shift)
        squares = pair.squares()[0] * pair.scale**2
        mean = squares.T @ pair.stratum_weight
        means.append((mean[:10].mean(), mean[10:].mean()))
    error = np.std(means, axis=0) / np.sqrt(150)
    assert np.all(np.abs(np.mean(means, axis=0) - [4.0, 0.0]) < 4 * error)


@pytest.mark.parametrize("n", [6, 9, 20])
def test_standardised_by_their_own_scatter_equal_sets_are_still_at_distance_nought(n: int) -> None:
    """With one replicate the scale is of the few records at hand, and small by chance where their noise is."""
    rng = np.random.default_rng(1)
    means = []
    for _ in range(400):
        pair = pair_of(n, 1, rng)
        means.append(pair.over_strata(pair.squares()).mean())
    error = float(np.std(means)) / 20
    assert abs(float(np.mean(means))) < 4 * error + 0.1 / n


@pytest.mark.parametrize("n", [4, 12, 30])
def test_the_floor_is_what_a_perfect_twin_shows(n: int) -> None:
    rng = np.random.default_rng(2)
    pairs = [pair_of(n, 20, rng) for _ in range(150)]
    overall, floor = np.mean([overall_of(p) for p in pairs]), np.mean([p.floor(rng, 40)[0] for p in pairs])
    assert 0.75 * floor < overall < 1.35 * floor


def test_one_line_and_a_broad_change_both_stand_above_the_floor() -> None:
    rng = np.random.default_rng(3)
    line = np.where(np.arange(BINS) == 7, 6.0, 0.0)
    for shift in (line, np.full(BINS, 1.0)):
        pair = pair_of(16, 10, rng, shift)
        assert overall_of(pair) > 4 * pair.floor(rng)[0]
        assert overall_of(pair) == pytest.approx(np.sqrt(np.mean(shift**2)), rel=0.2)


def test_a_gap_of_opposite_signs_in_two_faults_does_not_cancel() -> None:
    rng = np.random.default_rng(4)
    conditions = conditions_of(16)
    sign = np.where(np.arange(16) % 2 == 0, 2.0, -2.0)[:, None]
    pair = Paired(vectors_of(conditions, rng, sign), [vectors_of(conditions, rng) for _ in range(5)])
    assert overall_of(pair) > 1.5


def test_windows_of_one_recording_are_one_witness() -> None:
    """A recording's own peculiarity is no gap; taken window by window it would look like one."""
    rng = np.random.default_rng(5)
    conditions = conditions_of(32, ("outer",), per_group=4)
    alone = [replace(c, group=None) for c in conditions]
    squares = []
    for _ in range(100):
        own = np.repeat(rng.standard_normal((8, BINS)), 4, axis=0)
        real, sims = vectors_of(conditions, rng, own), [vectors_of(conditions, rng) for _ in range(5)]
        squares.append([Paired(replace(real, conditions=tuple(c)), sims).squares().mean() for c in (conditions, alone)])
    together, apart = np.mean(squares, axis=0)
    # Eight recordings know their scatter roughly, and what is divided by it is a little more than nothing on average.
    assert apart > 0.2 and abs(together) < 0.25 * apart


def run_of(n: int) -> tuple[Condition, ...]:
    """Two faults at two speeds, one record after the other."""
    return tuple(
        replace(c, time_s=60.0 * i, speed_rpm=(1500, 1800)[i // 2 % 2]) for i, c in enumerate(conditions_of(n))
    )


@pytest.mark.parametrize("m", [2, 5])
def test_what_goes_with_speed_or_with_the_run_is_a_gap_though_the_mean_is_none(m: int) -> None:
    rng, conditions = np.random.default_rng(9), run_of(24)
    of_run = np.linspace(-1, 1, 24)[:, None] * np.where(np.arange(BINS) < 10, 3.0, 0.0)
    found = []
    for _ in range(100):
        pair = Paired(vectors_of(conditions, rng, of_run), [vectors_of(conditions, rng) for _ in range(m)])
        mean = (pair.squares()[0] * pair.scale**2).T @ pair.stratum_weight
        found.append((mean[:10].mean(), mean[10:].mean()))
    error = np.std(found, axis=0) / 10
    expected = 9 * np.mean(np.linspace(-1, 1, 24) ** 2)
    assert abs(np.mean(found, axis=0)[1]) < 4 * error[1]  # nothing, where nothing goes with the run
    assert np.mean(found, axis=0)[0] == pytest.approx(expected, rel=0.05)


def test_replicates_must_match_the_records() -> None:
    rng = np.random.default_rng(6)
    real = vectors_of(conditions_of(4), rng)
    with pytest.raises(TwingapError, match="no simulated records"):
        Paired(real, [])
    with pytest.raises(TwingapError, match="against 4 records"):
        Paired(real, [vectors_of(conditions_of(3), rng)])


def test_what_is_plain_counts_by_its_logarithm_and_what_is_small_as_it_is() -> None:
    squares = np.array([-100.0, -0.5, 0.0, 3.0, 15.9, 16.0, 1e4, 1e6])
    found = compressed(squares)
    np.testing.assert_array_equal(found[1:6], squares[1:6])
    assert np.all(np.diff(found) > 0)
    assert found[0] == pytest.approx(-compressed(np.array([100.0]))[0])
    assert found[7] - found[6] == pytest.approx(16 * np.log(100))


def test_the_misfit_keeps_the_noise_of_means_and_is_never_less_than_what_lies_apart() -> None:
    rng = np.random.default_rng(8)
    for shift in (0.0, 2.0):
        pair = pair_of(6, 1, rng, shift)
        distance = float(pair.over_domains(pair.squares())[0][0])
        assert pair.misfit() > distance
    # Of one record a stratum the mean is the record.
    few = pair_of(1, 1, rng)
    assert few.misfit() == pytest.approx(
        float(np.sqrt(np.mean(compressed((few.difference[0] / few.scale) ** 2)))), rel=1e-9
    )


def test_the_misfit_gains_nothing_from_simulations_that_scatter_less() -> None:
    """With two replicates their noise is taken out: as far off, as near, whether simulations scatter or not."""
    rng, found = np.random.default_rng(4), {}
    for spread in (0.2, 2.0):
        squares = []
        for _ in range(200):
            conditions = conditions_of(6)
            real, sims = vectors_of(conditions, rng, 2.0), [vectors_of(conditions, rng) for _ in range(2)]
            noisy = [FeatureVectors({"order": spread * sim.matrix}, sim.axes, conditions) for sim in sims]
            squares.append([Paired(real, noisy[:m], np.ones(BINS)).misfit() ** 2 for m in (1, 2)])
        found[spread] = np.mean(squares, axis=0)
    one, two = found[2.0] - found[0.2]
    assert one > 1.0
    assert abs(two) < 0.1 * one


def test_residuals_are_those_of_the_misfit_and_what_is_plain_counts_less() -> None:
    rng = np.random.default_rng(9)
    faint, plain = pair_of(6, 1, rng, 0.5), pair_of(6, 1, rng, 9.0)
    assert float(((faint.residuals() ** 2).sum(axis=0) * faint.real.weight).sum()) == pytest.approx(faint.misfit() ** 2)
    np.testing.assert_array_equal(faint.counts(), faint.real.weight)
    assert np.all(plain.counts() <= plain.real.weight)
    assert plain.counts().sum() < 0.5
    # The weight is the slope of the tempered square: a little more of the gap adds as much to the misfit's square.
    squares = (plain.residuals() ** 2).sum(axis=0)
    more = (compressed(1.001 * squares) - compressed(squares)) @ plain.real.weight
    assert more == pytest.approx(0.001 * squares @ plain.counts(), rel=1e-3)
