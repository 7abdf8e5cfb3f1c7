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
