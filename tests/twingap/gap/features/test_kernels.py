"""Fast ways of computing against plain ones."""

from __future__ import annotations

import itertools
import math
import warnings

import numpy as np
import pytest
import scipy.optimize

from twingap.effects.modes import Mode
from twingap.gap.features.impacts import envelope_comb
from twingap.gap.features.spectrum import change, difference, path
from twingap.gap.features.tones import tones
from twingap.signal.record_transforms import known_medians, local_floor, medians


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
    assert tuple(envelope_comb._best_path(power, penalty)) == expected


def test_turns_are_exponentials() -> None:
    rates, grid = np.linspace(-9, 9, 7), np.asarray((np.arange(75) + 0.5) * 0.01, np.float64)
    assert np.abs(envelope_comb._turns(rates, grid) - np.exp(1j * rates[:, None] * grid)).max() < 1e-12


def test_what_differs_is_settled_as_repeated_weighted_least_squares_do() -> None:
    rng = np.random.default_rng(3)
    bands, count = 60, 25
    basis, settled = rng.normal(size=(5, bands)), np.array([1e-6, 1e-6, 1.0, 10.0, 100.0])
    target, weight = rng.normal(0, 3, bands), rng.uniform(0, 2, bands)
    curves = rng.normal(0, 3, (count, bands))
    costs, found = change._costs(curves, target, weight, basis, settled)
    for curve, cost, w in zip(curves, costs, found, strict=True):
        off, robust = target - curve * weight, np.ones(bands)
        for _ in range(4):
            wanted = np.linalg.solve((basis * robust) @ basis.T + np.diag(settled), (basis * robust) @ off)
            rest = off - wanted @ basis
            size = np.abs(rest)
            robust = np.minimum(1.0, change._ROBUST / np.maximum(size, 1e-300))
        np.testing.assert_allclose(w, wanted, rtol=1e-8, atol=1e-10)
        robust_square = np.where(size <= change._ROBUST, size**2, change._ROBUST * (2 * size - change._ROBUST))
        assert cost == pytest.approx(settled @ wanted**2 + robust_square.sum(), rel=1e-9)


def test_the_nearest_candidate_is_that_of_all_sums_written_out() -> None:
    rng = np.random.default_rng(4)
    points = 32
    low, high = np.sort(rng.integers(0, points + 1, (2, 50)), axis=0)
    place = np.arange(points)
    ratio = np.where((place >= low[:, None]) & (place < high[:, None]), rng.uniform(0, 3, (50, points)), 0.0)
    factor = rng.uniform(0.1, 10, (50, 3))
    for _ in range(10):
        curve = rng.normal(0.5, 1, points)
        squares = ((curve - np.log1p(ratio[:, None] * factor[:, :, None])) ** 2).sum(axis=2)
        least, best, choice = difference._best_fit(curve, ratio, factor, low, high)
        assert least == pytest.approx(squares.min(), rel=1e-12)
        assert (best, choice) == np.unravel_index(np.argmin(squares), squares.shape)


def _plain_misfit(curves: path._Curves, at: np.ndarray, model: int) -> float:
    """Misfit of one candidate: response at each frequency, non-negative least squares, Huber's loss."""
    z = np.exp(-2j * math.pi * (np.arange(path.BANDS * path.FINE) + 0.5) / (2 * path.BANDS * path.FINE))
    response = np.zeros(z.size, complex)
    for place, damping, gain in [(at[0], at[1], 1.0), *([at[2:5]] if model == path._TWO else [])]:
        pole = np.exp(2 * math.pi * place * complex(-damping, math.sqrt(1 - damping**2)))
        enters = Mode(place, damping).noise_gain(1.0)
        response += gain * (enters / (1 - pole * z) - enters.conjugate() / (1 - pole.conjugate() * z)) / 2j
    power, added = np.abs(response) ** 2, np.zeros(path.BANDS)
    if model == path._ROLLED:
        kept = 1 / (1 + ((np.arange(z.size) + 0.5) / (2 * z.size) / at[2]) ** (2 * at[3]))
        power, added = power * kept, kept.reshape(path.BANDS, path.FINE).mean(axis=1)
    mode = np.exp(np.log(power).reshape(path.BANDS, path.FINE).mean(axis=1)) / power.mean()
    columns = [[mode, mode * kind, np.ones_like(mode), added] for kind in curves.with_impacts]
    scales = curves.curves * curves.sigma[:, None]
    basis = np.concatenate([np.array(c).T / scale[:, None] for c, scale in zip(columns, scales, strict=True)])
    sigma = np.repeat(curves.sigma, path.BANDS)
    weights, _ = scipy.optimize.nnls(basis, 1 / sigma)
    off = np.abs(np.log(np.clip(basis @ weights * sigma, 0.05, 20.0))) / sigma
    return float(np.sum(np.where(off < path._ROBUST, off**2, path._ROBUST * (2 * off - path._ROBUST))))


@pytest.mark.parametrize("model", [path._PLAIN, path._TWO, path._ROLLED])
def test_the_best_path_is_that_of_least_squares_written_out(model: int) -> None:
    rng = np.random.default_rng(5)
    f = (np.arange(path.BANDS) + 0.5) / (2 * path.BANDS)
    logs = rng.normal(0, 0.3, (2, f.size)) + np.log(1 + 20 * np.exp(-(((f - 0.2) / 0.03) ** 2)))
    at = np.column_stack((
        rng.choice([0.1, 0.2, 0.3], 40), rng.choice([0.03, 0.1], 40), rng.uniform(0.05, 0.45, 40),
        rng.integers(1, 4, 40) if model == path._ROLLED else rng.uniform(0.01, 0.1, 40), rng.uniform(-2, 2, 40),
    ))  # fmt: skip
    curves = path._Curves(list(logs), [0.2, 0.3], [False, True])
    expected = [_plain_misfit(curves, row, model) for row in at]
    found = curves._best(at, model)
    assert found.cost == pytest.approx(min(expected), rel=1e-6)
    assert found.at == tuple(at[int(np.argmin(expected))])


def test_medians_of_what_is_known_are_those_of_numpy() -> None:
    rng = np.random.default_rng(6)
    for shape in ((24, 70), (9, 40), (1, 5), (2, 30)):
        values = rng.standard_normal(shape)
        values[rng.random(shape) < 0.4] = np.nan
        values[:, 0] = np.nan
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a column without any number
            np.testing.assert_array_equal(known_medians(values), np.nanmedian(values, axis=0))
