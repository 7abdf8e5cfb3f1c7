"""A mode in parallel with a path: what phases a spectrum has, and what adding a mode to it does."""

import numpy as np
import pytest

from twingap.gap.features.impacts import parallel_mode
from twingap.gap.features.impacts.parallel_mode import Path, least_phase

BANDS = 128
F = (np.arange(BANDS) + 0.5) / (2 * BANDS)


def response(f, place, damping):
    """Transform of samples of exp(-damping w t) sin(w_d t), the one sample of delay left out."""
    w, turned = 2 * np.pi * place, 2 * np.pi * place * np.sqrt(1 - damping**2)
    n = np.arange(1, 4000)
    samples = np.exp(-damping * w * n) * np.sin(turned * n)
    return samples @ np.exp(-2j * np.pi * np.outer(n - 1, f))


@pytest.mark.parametrize("place", [0.08, 0.2, 0.3])
def test_the_least_phase_of_a_mode_is_that_of_its_samples(place):
    true = response(F, place, 0.05)
    found = least_phase(np.abs(true) ** 2)
    assert np.abs(found) == pytest.approx(np.abs(true), rel=1e-9)
    assert np.angle(found / true) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("place", [0.08, 0.2, 0.3])
def test_the_response_of_a_mode_is_least_phase_and_has_the_power_of_all_aliases(place):
    shape = parallel_mode.mode_response(F, place, 0.05)
    s = 2j * np.pi * (F[:, None] + np.arange(-200, 201))
    pole = 2 * np.pi * place * complex(-0.05, np.sqrt(1 - 0.05**2))
    power = (1 / np.abs((s - pole) * (s - np.conj(pole))) ** 2).sum(axis=1)
    assert np.abs(shape) ** 2 / np.abs(shape[3]) ** 2 == pytest.approx(power / power[3], rel=2e-3)
    assert np.angle(least_phase(np.abs(shape) ** 2) / shape) == pytest.approx(0.0, abs=0.02)
    assert np.abs(shape).max() == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize("against", [1.0, -1.0])
def test_a_mode_in_parallel_raises_one_side_and_lowers_the_other(against):
    power = np.abs(parallel_mode.mode_response(F, 0.12, 0.05)) ** 2
    path = Path([power], [0.0], [True])
    curves, ((place, damping, gain),), _ = path.curves(np.array([0.2]), (0.06,), (against * 0.5,))
    assert (place, damping) == (0.2, 0.06)
    assert np.sign(gain) == against
    unit = np.sqrt(power.max())
    alone = parallel_mode.mode_response(F, 0.12, 0.05) / unit
    true = np.log(np.abs(1 + gain * parallel_mode.mode_response(F, 0.2, 0.06) / alone) ** 2)
    assert np.median(np.abs(curves[0] - true)) < 0.03
    assert curves[0].max() > 0.5 and curves[0].min() < -0.3


def test_white_noise_is_left_alone():
    """Where nothing has passed the path, no mode adds anything, whatever its gain over the path."""
    white = 1.0
    power = white + np.abs(parallel_mode.mode_response(F, 0.12, 0.03)) ** 2 * np.where(
        np.abs(F - 0.12) < 0.05, 9.0, 1e-6
    )
    path = Path([power], [0.95 * white], [True])
    (curve,), _, _ = path.curves(np.array([0.12]), (0.03,), (1.0,))
    assert curve[np.abs(F - 0.12) < 0.005].max() > 0.5
    assert np.abs(curve[F > 0.3]).max() < 0.2
