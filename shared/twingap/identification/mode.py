"""The healthy model: white noise through one damped mode, plus white noise, as a spectrum.

The structure noise is what h(t) = exp(-zeta w t) sin(sqrt(1 - zeta^2) w t) makes of a white force in continuous time,
so its autocovariance is known in closed form (Crandall and Mark, Random Vibration in Mechanical Systems, 1963, ch. 2);
the autocovariance of its samples is the same at their lags.
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
    skew = zeta / np.sqrt(1 - np.asarray(zeta, float) ** 2)
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
    """Integral of h^2 over time, times fs_hz: the energy that one unit impact leaves in samples, whenever it comes."""
    w = 2 * np.pi * frequency_hz / fs_hz
    pole = complex(-damping_ratio * w, np.sqrt(1 - damping_ratio**2) * w)
    # h = Im exp(pole t), so that h^2 is half of |exp(pole t)|^2 less Re exp(2 pole t).
    return 0.5 * (-1 / (2 * pole.real) - (-1 / (2 * pole)).real)
