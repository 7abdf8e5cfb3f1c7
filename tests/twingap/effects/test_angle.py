"""Waveforms over shaft angle: harmonics to rounding, and reading between samples."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.effects.angle import at_angles, cosine, harmonics


def test_cosine_is_exact_to_rounding() -> None:
    turns = np.concatenate((np.random.default_rng(0).uniform(-40, 40, 10_000), np.arange(-8, 8) / 8))
    exact = np.cos(2 * np.pi * (turns - np.rint(turns)))
    np.testing.assert_allclose(cosine(turns), exact, atol=4e-15)


@pytest.mark.parametrize("n", [0, 1, 255, 256, 257, 1000])
def test_harmonics_are_their_sum(n: int) -> None:
    rng = np.random.default_rng(1)
    turns, amplitudes = rng.uniform(0, 5, n), rng.normal(size=7) + 1j * rng.normal(size=7)
    expected = sum((a * np.exp(2j * np.pi * k * turns)).real for k, a in enumerate(amplitudes, 1))
    np.testing.assert_allclose(harmonics(turns, amplitudes.tolist()), expected, atol=1e-12)
    np.testing.assert_array_equal(harmonics(turns, []), np.zeros(n))


def test_reading_at_other_angles_keeps_the_waveform() -> None:
    turns = np.linspace(0, 10, 4001)
    x = np.sin(2 * np.pi * 110 * turns)  # a little above a quarter of the rate
    between = turns[50:-50] + 0.37 * (turns[1] - turns[0])
    np.testing.assert_allclose(at_angles(x, turns, between), np.sin(2 * np.pi * 110 * between), atol=0.02)
    np.testing.assert_allclose(at_angles(x, turns, turns), x, atol=1e-9)


@pytest.mark.parametrize(("n", "part"), [(300, 0.05), (300, 0.3), (4001, 0.3), (4001, 0.45)])
def test_what_lies_near_half_the_rate_is_kept_between_samples(n: int, part: float) -> None:
    places = np.arange(n, dtype=float)
    ends = 40 if part < 0.4 else 400  # near half the rate the mirrored ends are heard further in
    between = places[ends:-ends] + 0.37
    read = at_angles(np.sin(2 * np.pi * part * places), places, between)
    np.testing.assert_allclose(read, np.sin(2 * np.pi * part * between), atol=0.02)


def test_white_noise_read_between_samples_stays_white() -> None:
    x = np.random.default_rng(3).standard_normal(40_000)
    places = np.arange(x.size, dtype=float)
    read = at_angles(x, places, places + 0.5)
    power = [np.abs(np.fft.rfft(y)) ** 2 for y in (x, read)]
    upper = slice(15_000, 19_000)  # 0.375 to 0.475 of the rate
    assert power[1][upper].mean() == pytest.approx(power[0][upper].mean(), rel=0.03)
