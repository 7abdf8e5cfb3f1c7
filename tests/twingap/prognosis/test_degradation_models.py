"""Degradation curves: known ones recovered, bounds kept, criteria that prefer the true model, no later row read."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from twingap.errors import TwingapError
from twingap.prognosis.degradation_forecast import (
    _local_spread,
    out_of_sample,
    redrawn,
    refitted,
    remaining_life,
    rows_until,
)
from twingap.prognosis.degradation_models import AMPLITUDE_LIMIT, MODELS, checked, fit_curve, whitened
from twingap.prognosis.information import criteria, memory_of

Array = NDArray[np.float64]
T = 10.0 * np.arange(301)
U = T / T[-1]
TRUE = {
    "constant": ((2.0,), (), np.full_like(U, 2.0)),
    "exponential": ((3.0,), (4.0,), 3 * np.exp(4 * (U - 1))),
    "exponential with offset": ((3.0, 1.0), (8.0,), 3 * np.exp(8 * (U - 1)) + 1),
    "power": ((5.0,), (2.5,), 5 * U**2.5),
    "polynomial 2": ((1.0, -2.0, 5.0), (), 1 - 2 * U + 5 * U**2),
    "polynomial 3": ((1.0, 1.0, -3.0, 5.0), (), 1 + U - 3 * U**2 + 5 * U**3),
    "combined power 3": ((4.0, 1.0), (6.3,), 4 * U**6.3 + 1),
    "combined power 5": ((2.0, 6.0, 1.0), (0.7, 15.0), 2 * U**0.7 + 6 * U**15 + 1),
}


def noisy(curve: Array, sd: float, memory: float, rng: np.random.Generator) -> Array:
    """AR(1) noise on a curve."""
    shocks = sd * rng.standard_normal(curve.size)
    shocks[1:] *= np.sqrt(1 - memory**2)
    return np.asarray(curve + lfilter([1.0], [1.0, -memory], shocks))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("robust", [False, True])
def test_a_curve_without_noise_is_found_again(name: str, robust: bool) -> None:
    coefficients, exponents, curve = TRUE[name]
    fit = fit_curve(MODELS[name], T + 500, curve, robust=robust)
    assert fit.coefficients == pytest.approx(coefficients, rel=1e-3, abs=1e-3)
    assert fit.exponents == pytest.approx(exponents, rel=1e-3)
    assert fit.rmse < 1e-4 and not fit.at_bound
    later = T[-1] + 500 + np.array([[100.0], [200.0]])
    assert fit.at(later).shape == (2, 1)


@pytest.mark.parametrize("name", MODELS)
def test_slopes_are_those_of_the_columns(name: str) -> None:
    """Against differences, at u = 0 and beyond 1 too."""
    model, u = MODELS[name], np.array([0.0, 0.3, 1.0, 1.5])
    exponents = (0.9, 3.0)[: len(model.starts)]
    per = {k: slope for k, (_, slope) in enumerate(model.slopes(u, exponents))}
    for k, (column, slope) in enumerate(model.slopes(u, exponents)):
        ahead = tuple(e + 1e-6 * (n == k) for n, e in enumerate(exponents))
        behind = tuple(e - 1e-6 * (n == k) for n, e in enumerate(exponents))
        change = (model.columns(u, ahead)[column] - model.columns(u, behind)[column]) / 2e-6
        assert slope == pytest.approx(change, abs=1e-6)
    assert len(per) == len(model.starts)


def test_least_squares_agrees_with_a_plain_search() -> None:
    """The best of a dense grid of exponents, linear in the rest, is no better."""
    rng = np.random.default_rng(0)
    y = noisy(TRUE["combined power 3"][2], 0.2, 0.5, rng)
    fit = fit_curve(MODELS["combined power 3"], T, y)
    best = min(
        float(np.sum((y - d @ np.linalg.lstsq(d, y, rcond=None)[0]) ** 2))
        for b in np.linspace(4, 9, 2001)
        for d in [np.stack([U**b, np.ones_like(U)], axis=1)]
    )
    assert np.sum(fit.residuals**2) == pytest.approx(best, rel=1e-6)


def test_spikes_move_a_robust_fit_less() -> None:
    rng = np.random.default_rng(1)
    y = noisy(TRUE["combined power 3"][2], 0.05, 0.0, rng)
    y[100:140:5] += 30
    off = {
        robust: float(np.abs(fit_curve(MODELS["combined power 3"], T, y, robust=robust).at(T) - TRUE[
            "combined power 3"][2]).max())
        for robust in (False, True)
    }  # fmt: skip
    assert off[True] < 0.05 < 0.5 < off[False]


@pytest.mark.parametrize("name", MODELS)
def test_bounds_hold_whatever_is_fitted(name: str) -> None:
    """A step in the last row, and noise alone, drive parameters to their bounds and not beyond."""
    for y in (np.where(U < 1, 0.0, 1.0), np.random.default_rng(2).standard_normal(U.size)):
        fit = fit_curve(MODELS[name], T, y)
        low, high = MODELS[name].bounds
        assert np.isfinite(fit.at(20 * T[-1]))
        assert (np.abs(fit.coefficients) <= AMPLITUDE_LIMIT * np.abs(y).max() * (1 + 1e-9)).all()
        assert all(low <= e <= high for e in fit.exponents)
    assert fit_curve(MODELS[name], T, np.zeros_like(T)).at(T) == pytest.approx(0)


@pytest.mark.parametrize("memory", [0.0, 0.8])
@pytest.mark.parametrize("name", ["constant", "exponential with offset", "polynomial 2", "combined power 5"])
def test_criteria_prefer_the_true_model(name: str, memory: float) -> None:
    """BIC with AR(1) residuals: in most simulated runs, and never by much another."""
    rng = np.random.default_rng(3)
    first, behind = 0, []
    for _ in range(10):
        y = noisy(TRUE[name][2], 0.03, memory, rng)
        bic = {other: criteria(fit_curve(MODELS[other], T, y)).bic_ar1 for other in MODELS}
        first += min(bic, key=lambda other: bic[other]) == name
        behind.append(bic[name] - min(bic.values()))
    assert first >= 7 and np.median(behind) == 0 and max(behind) < 10


def test_residuals_with_memory_fool_criteria_that_take_them_as_independent() -> None:
    rng = np.random.default_rng(4)
    fooled = {"bic": 0, "bic_ar1": 0}
    for _ in range(20):
        y = noisy(np.full_like(U, 2.0), 0.1, 0.9, rng)
        found = {name: criteria(fit_curve(MODELS[name], T, y)) for name in ("constant", "polynomial 3")}
        for key in fooled:
            fooled[key] += getattr(found["polynomial 3"], key) < getattr(found["constant"], key)
    assert fooled["bic"] >= 10 and fooled["bic_ar1"] <= 3


def test_criteria_by_hand() -> None:
    """A constant: mean and variance in closed form; the memory known."""
    y = np.array([1.0, 2.0, 4.0, 3.0, 5.0, 1.0, 2.0, 2.0])
    found = criteria(fit_curve(MODELS["constant"], np.arange(8.0), y))
    deviance = 8 * (np.log(2 * np.pi * y.var()) + 1)
    assert found.bic == pytest.approx(deviance + 2 * np.log(8))
    assert found.aicc == pytest.approx(deviance + 4 + 12 / 5)
    e = y - y.mean()
    assert found.memory == pytest.approx(np.sum(e[1:] * e[:-1]) / np.sum(e**2))
    assert memory_of(np.zeros(4)) == 0
    assert whitened(e, 0.5)[1:] == pytest.approx(e[1:] - 0.5 * e[:-1])


def test_a_fit_at_a_share_of_life_reads_no_later_row() -> None:
    rng = np.random.default_rng(5)
    y = noisy(TRUE["combined power 5"][2], 0.1, 0.5, rng)
    rows = rows_until(T, 0.6)
    assert rows == 181
    changed = y.copy()
    changed[rows:] = -100
    a, b = (out_of_sample(MODELS["combined power 5"], T, v, shares=(0.6,))[0] for v in (y, changed))
    assert a.rows == b.rows == rows and a.rmse_rest < b.rmse_rest
    fit = fit_curve(MODELS["combined power 5"], T[:rows], y[:rows])
    assert a.rmse_rest == pytest.approx(np.sqrt(np.mean((fit.at(T[rows:]) - y[rows:]) ** 2)))
    near = (np.arange(T.size) >= rows) & (0.7 * T[-1] >= T)
    assert a.rmse_next == pytest.approx(np.sqrt(np.mean((fit.at(T[near]) - y[near]) ** 2)))


def test_remaining_life_of_a_known_curve() -> None:
    curve = 1 + 4 * (1.25 * U) ** 3  # reaches 5 when U = 0.8
    rows = rows_until(T, 0.6)
    rng = np.random.default_rng(6)
    fit = fit_curve(MODELS["combined power 3"], T[:rows], curve[:rows] + 0.01 * rng.standard_normal(rows))
    curves = redrawn(fit, 100, rng)
    life = remaining_life(curves, 5.0)
    assert life.life_s == pytest.approx(0.2 * T[-1], rel=0.1)
    assert life.low_s <= 0.2 * T[-1] <= life.high_s and life.never == 0
    assert remaining_life(curves, 1.2).life_s == 0  # passed already
    assert remaining_life(curves, -50.0, rising=False).life_s == np.inf
    assert remaining_life(curves, -50.0, rising=False).never == 1


def test_intervals_hold_about_as_often_as_stated() -> None:
    """Right model, noise with memory: 90 % stated, 60 runs; the study counts more of them."""
    rng = np.random.default_rng(7)
    rows, inside = rows_until(T, 0.8), 0
    curve = TRUE["combined power 3"][2]
    for _ in range(60):
        y = noisy(curve, 0.1, 0.5, rng)
        life = remaining_life(redrawn(fit_curve(MODELS["combined power 3"], T[:rows], y[:rows]), 100, rng), 5.0)
        inside += life.low_s <= T[-1] - T[rows - 1] <= life.high_s
    assert 0.78 <= inside / 60 <= 0.99


def test_bands_hold_the_curve_and_the_records() -> None:
    rng = np.random.default_rng(8)
    curve = TRUE["combined power 3"][2]
    y = noisy(curve, 0.1, 0.0, rng)
    curves = redrawn(fit_curve(MODELS["combined power 3"], T, y), 200, rng)
    low, high = curves.band(T)
    assert np.mean((low <= curve) & (curve <= high)) > 0.6  # one run: neighbouring rows err together
    wide = curves.band(T, rng=rng)
    assert 0.85 < np.mean((wide[0] <= y) & (y <= wide[1])) < 0.95
    assert ((wide[1] - wide[0]) > (high - low)).mean() > 0.99


def test_many_refits_are_those_of_one_by_one() -> None:
    rng = np.random.default_rng(9)
    for name in ("polynomial 3", "exponential with offset", "combined power 3", "combined power 5"):
        model = MODELS[name]
        y = np.stack([noisy(TRUE[name][2], 0.1, 0.0, rng) for _ in range(4)], axis=1)
        size = np.abs(y).max()
        coefficients, exponents = refitted(model, U, y / size, TRUE[name][1])
        for column, c, e in zip(y.T, coefficients * size, exponents, strict=True):
            alone = fit_curve(model, T, column)
            many = float(np.sum((model.curve(U, c, tuple(e)) - column) ** 2))
            assert many == pytest.approx(np.sum(alone.residuals**2), rel=1e-4)


def test_long_runs_are_thinned_and_say_the_same() -> None:
    t = np.arange(3000.0)
    y = noisy(1 + 4 * (t / t[-1]) ** 4, 0.1, 0.0, np.random.default_rng(10))
    curves = redrawn(fit_curve(MODELS["combined power 3"], t, y), 100, np.random.default_rng(0))
    low, high = curves.band(t)
    curve = 1 + 4 * (t / t[-1]) ** 4
    assert np.mean((low <= curve) & (curve <= high)) > 0.5
    assert np.median(high - low) < 0.05
    assert curves.scatter == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize(
    ("time_s", "values", "said"),
    [
        ([0.0, 2.0, 1.0, 3.0, 4.0], [1.0] * 5, "do not increase"),
        ([1.0] * 5, [1.0] * 5, "do not increase"),
        ([0.0, 1.0, 2.0, 3.0, 4.0], [1.0, np.nan, 1.0, 1.0, 1.0], "NaN"),
        ([0.0, 1.0], [1.0, 2.0], "at least 3"),
        ([0.0, 1.0, 2.0], [1.0, 2.0], "one time per value"),
    ],
)
def test_what_no_curve_can_be_laid_through_is_refused(time_s: list[float], values: list[float], said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        checked(time_s, values, at_least=3)
    with pytest.raises(TwingapError, match="between 0 and 1"):
        out_of_sample(MODELS["constant"], T, U, shares=(1.0,))


def test_two_rows_of_one_time_are_kept() -> None:
    """Loggers round times; two rows of one second are two rows."""
    time_s, _ = checked([0.0, 1.0, 1.0, 2.0], [1.0, 2.0, 3.0, 4.0], at_least=3)
    assert time_s.tolist() == [0.0, 1.0, 1.0, 2.0]


@pytest.mark.parametrize("rows", [1, 2, 29, 30, 31, 150, 153, 300, 1000])
def test_local_spread_is_that_of_a_convolution_without_its_cost(rows: int) -> None:
    """As NumPy centres it; a spike of a million leaves no rounding behind it."""
    off = np.random.default_rng(rows).standard_normal(rows)
    kernel = np.ones(min(max(30, rows // 5), rows))
    expected = np.sqrt(np.convolve(off**2, kernel, "same") / np.convolve(np.ones(rows), kernel, "same"))
    np.testing.assert_allclose(_local_spread(off), expected, rtol=1e-12)
    if rows > 500:
        off[10] = 1e9
        np.testing.assert_allclose(_local_spread(off)[300:], expected[300:], rtol=1e-12)
