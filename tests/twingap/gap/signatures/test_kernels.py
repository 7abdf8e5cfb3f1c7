"""Fast ways of computing against plain ones."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from twingap.gap.signatures import comb, tones
from twingap.gap.view import local_floor, medians


@pytest.mark.parametrize("width", [1, 2, 3, 8, 31, 32, 101])
def test_medians_are_medians(width: int) -> None:
    values = np.random.default_rng(width).exponential(size=(40, width))
    np.testing.assert_array_equal(medians(values), np.median(values, axis=1))


def test_floor_is_the_running_median_at_every_eighth_bin() -> None:
    power = np.random.default_rng(1).exponential(size=4000)
    floor = local_floor(power, 101)
    padded = np.pad(power, 50, mode="reflect")
    for place in (0, 8, 800, 3992):
        assert floor[place] == np.median(padded[place : place + 101])


@pytest.mark.parametrize("based", [False, True])
def test_comb_scores_count_lines_on_multiples(based: bool) -> None:
    rng = np.random.default_rng(2)
    hz, weights, widths = np.sort(rng.uniform(5, 400, 30)), rng.uniform(0.3, 1.5, 30), rng.uniform(0.2, 1.0, 30)
    bases = np.linspace(10, 90, 300)
    expected = []
    for base in bases:
        total, first = 0.0, False
        for line, weight, width in zip(hz, weights, widths, strict=True):
            k = math.floor(line / base + 0.5)
            off = abs(line - k * base) / (2.5 * width)
            if 1 <= k <= 6 and off < 1:
                total, first = total + weight * (1 - off**2), first or k == 1
        expected.append(total if first or not based else 0.0)
    np.testing.assert_allclose(tones.comb_scores(hz, weights, widths, bases, 6, based), expected, rtol=1e-12)


def test_block_floor_is_interpolated_between_the_middles_of_blocks() -> None:
    power = np.random.default_rng(3).exponential(size=32 * 9 + 5) * np.linspace(1, 50, 32 * 9 + 5)
    middles = np.median(power[: 32 * 9].reshape(9, 32), axis=1)
    ends = np.pad(middles, 1, mode="edge")
    logs = np.log(np.minimum(middles, 2 * np.maximum(ends[:-2], ends[2:])))
    ends = np.pad(logs, 1, mode="edge")
    smooth = 0.25 * ends[:-2] + 0.5 * logs + 0.25 * ends[2:]
    expected = np.exp(np.interp(np.arange(power.size), (np.arange(9) + 0.5) * 32, smooth))
    np.testing.assert_allclose(tones.block_floor(power), expected, rtol=1e-12)


def test_look_up_finds_the_largest_bin_within_reach() -> None:
    spectrum, floor = np.ones(200), np.ones(200)
    spectrum[52] = 100.0
    logs, power = np.full(3, np.nan), np.full(3, np.nan)
    tones.look_up(spectrum, floor, np.array([50.0, 120.0, 199.0]), 0.02, logs, power)
    bins = 5  # one bin and two per cent of fifty, either side
    noise = (math.log(bins / 1.3) + 0.577) / math.log(2)
    assert logs[0] == pytest.approx(math.log10(100 / noise))
    assert power[0] == pytest.approx(102 / 1.5)
    assert logs[1] < 0
    assert np.isnan(logs[2])


def test_best_path_is_the_best_of_all_paths() -> None:
    rng = np.random.default_rng(4)
    power, place = rng.exponential(size=(5, 4)), np.arange(4)
    penalty = 0.3 * (place[:, None] - place) ** 2.0

    def gain(path: tuple[int, ...]) -> float:
        steps = sum(float(penalty[a, b]) for a, b in itertools.pairwise(path))
        return sum(float(power[row, at]) for row, at in enumerate(path)) - steps

    expected = max(itertools.product(range(4), repeat=5), key=gain)
    assert tuple(comb._best_path(power, penalty)) == expected


def test_turns_are_exponentials() -> None:
    rates, grid = np.linspace(-9, 9, 7), np.asarray((np.arange(75) + 0.5) * 0.01, np.float64)
    assert np.abs(comb._turns(rates, grid) - np.exp(1j * rates[:, None] * grid)).max() < 1e-12
