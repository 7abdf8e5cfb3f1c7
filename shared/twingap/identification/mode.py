"""The healthy model: white noise through one damped mode, plus white noise, as a spectrum.

Sampling h(t) = exp(-zeta w t) sin(sqrt(1 - zeta^2) w t) makes the structure noise an autoregression of order two, so
its autocovariance is known in closed form (Box and Jenkins, Time Series Analysis, section 3.2).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit

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
    w, zeta = np.broadcast_arrays(2 * np.pi * np.asarray(frequency_hz, float) / fs_hz, damping_ratio)
    r, theta = np.exp(-zeta * w), np.sqrt(1 - np.asarray(zeta, float) ** 2) * w
    skew = (1 - r**2) / (1 + r**2) / np.tan(theta)
    out = np.empty((*np.shape(r), lags))
    _turned(np.ravel(r), np.ravel(theta), np.ravel(skew), out.reshape(-1, lags))
    return out


@njit()
def _turned(r, theta, skew, out):  # type: ignore[no-untyped-def]  # pragma: no cover
    """r^m (cos(m theta) + skew sin(m theta)), turned on from lag to lag: a sine and a cosine in all, not two each."""
    for k in range(out.shape[0]):
        c, s = r[k] * math.cos(theta[k]), r[k] * math.sin(theta[k])
        real, imag = 1.0, 0.0
        for m in range(out.shape[1]):
            out[k, m] = real + skew[k] * imag
            real, imag = real * c - imag * s, real * s + imag * c


def impulse_energy(frequency_hz: float, damping_ratio: float, fs_hz: float) -> float:
    """Sum of h^2 over samples: the energy that one unit impact leaves, times fs_hz."""
    w = 2 * np.pi * frequency_hz / fs_hz
    r, theta = np.exp(-damping_ratio * w), np.sqrt(1 - damping_ratio**2) * w
    # sum of r^2k sin^2(k theta) = half of (geometric series - real part of the complex one)
    return float(0.5 * (1 / (1 - r**2) - ((1 - r**2 * np.exp(2j * theta)) ** -1).real))
