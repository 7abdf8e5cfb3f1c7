"""Gaussian noise of a given power density, by spectral representation."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Array = NDArray[np.float64]


def shaped_noise(
    n: int, fs_hz: float, frequencies_hz: tuple[float, ...], densities_db: tuple[float, ...], rng: np.random.Generator
) -> Array:
    """[n] Noise of this one-sided density, dB of squared units per Hz: straight lines between the frequencies."""
    # Noise from a transform is periodic: twice as long as the record, its end is not correlated with its start.
    length = scipy.fft.next_fast_len(2 * n, real=True)
    weights = _amplitudes(length, fs_hz, frequencies_hz, densities_db)
    spectrum = rng.standard_normal(2 * weights.size).view(complex)
    spectrum *= weights
    return np.asarray(scipy.fft.irfft(spectrum, length)[:n])


@lru_cache(maxsize=16)
def _amplitudes(n: int, fs_hz: float, frequencies_hz: tuple[float, ...], densities_db: tuple[float, ...]) -> Array:
    """[n // 2 + 1] Factors that make unit complex normals the spectrum of noise of this one-sided density."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    density = np.power(10, np.interp(f, frequencies_hz, densities_db) / 10)
    # A one-sided density S makes E|X|^2 = S fs n / 2 = 2 w^2.
    weights = np.sqrt(density * (fs_hz * n / 4))
    weights[0] = 0.0
    if n % 2 == 0:
        weights[-1] *= math.sqrt(2)  # real there
    return np.asarray(weights)
