"""Sampling of an impulse response: power of a continuous mode over that of samples of its ring-down.

samples of ring-down: 1 / (2 (cos w - cos theta)) --ratio, smooth, 1 at the mode--> continuous: 1 / (1 - (f / mode)^2)
"""

from __future__ import annotations

import math

import numpy as np

from twingap.records import Array


def continuous(f: Array, mode: float) -> Array:
    """ln of the power of a mode's displacement over that of samples of its ring-down, both equal at the mode.

    Samples of exp(s t), s = j theta fs, are the response 1 / (2 (cos(2 pi f) - cos(theta))) to a force on the grid of
    samples. The response of a structure to a continuous force is 1 / (1 - (f / mode)^2), which falls more steeply
    beyond the mode (impulse invariance: Oppenheim and Schafer, Discrete-Time Signal Processing, 2010, ch. 7).
    Frequencies are parts of the sampling rate.
    """
    theta, w = 2 * np.pi * mode, 2 * np.pi * np.asarray(f)
    w = np.where(np.abs(w - theta) < 1e-3, theta + 1e-3, w)  # at the mode both are the same
    ratio = np.abs(np.cos(w) - math.cos(theta)) / np.abs(1 - (w / theta) ** 2)
    return np.asarray(2 * np.log(ratio / (0.5 * theta * math.sin(theta))))
