"""The healthy model: white noise through one damped mode, plus white noise, as a spectrum.

Sampling h(t) = exp(-zeta w t) sin(sqrt(1 - zeta^2) w t) makes the structure noise an autoregression of order two, so
its autocovariance is known in closed form (Box and Jenkins, Time Series Analysis, section 3.2).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def autocorrelation(frequency_hz: Array | float, damping_ratio: Array | float, fs_hz: float, lags: int) -> Array:
    """Autocorrelation of sampled structure noise, 1 at lag 0.

    Parameters
    ----------
    frequency_hz : Array [...] or float
        Natural frequency, Hz, below fs_hz / 2.
    damping_ratio : Array [...] or float
        Between 0 and 1.
    fs_hz : float
    lags : int

    Returns
    -------
    Array [..., lags]
    """
    w = 2 * np.pi * np.asarray(frequency_hz, float)[..., None] / fs_hz
    zeta = np.asarray(damping_ratio, float)[..., None]
    r, theta = np.exp(-zeta * w), np.sqrt(1 - zeta**2) * w
    m = np.arange(lags)
    skew = (1 - r**2) / (1 + r**2) / np.tan(theta)
    return np.asarray(r**m * (np.cos(theta * m) + skew * np.sin(theta * m)))


def impulse_energy(frequency_hz: float, damping_ratio: float, fs_hz: float) -> float:
    """Sum of h^2 over samples: the energy that one unit impact leaves, times fs_hz."""
    w = 2 * np.pi * frequency_hz / fs_hz
    r, theta = np.exp(-damping_ratio * w), np.sqrt(1 - damping_ratio**2) * w
    # sum of r^2k sin^2(k theta) = half of (geometric series - real part of the complex one)
    return float(0.5 * (1 / (1 - r**2) - ((1 - r**2 * np.exp(2j * theta)) ** -1).real))
