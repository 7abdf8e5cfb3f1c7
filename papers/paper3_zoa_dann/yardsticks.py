"""What a method must beat: guessing, and the analyst who reads the envelope spectrum.

windows --> squared-envelope spectrum --> prominence at the fault orders --> the strongest, or healthy
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from twingap.adapt import Windows
from twingap.bearing import Bearing
from twingap.signal.envelope import lines_at, squared_envelope_spectrum
from twingap.signal.spectrum import Spectrum

Array = NDArray[np.float64]
HARMONICS = 2
TOLERANCE = 0.02
"""Bearings slip by up to a per cent or two."""


def majority(labels: NDArray[np.int64], n_classes: int) -> float:
    """Accuracy of calling everything the class that is most frequent among the windows judged."""
    return float(np.bincount(labels, minlength=n_classes).max() / labels.size)


def analyst(windows: Windows, bearing: Bearing, classes: tuple[str, ...], false_alarm: float) -> Array:
    """The analyst's rule: the fault whose order stands out most in the squared-envelope spectrum, or healthy.

    Parameters
    ----------
    windows : Windows
    bearing : Bearing
    classes : tuple[str, ...]
        "healthy" among them.
    false_alarm : float
        Share of structureless windows (white noise) that the rule calls faulty; its threshold is set by simulating
        them. No record is looked at for that.

    Returns
    -------
    Array [windows, classes]
        One-hot.
    """
    length = windows.samples.shape[1]
    chosen = np.zeros((len(windows), len(classes)))
    faults = tuple(c for c in classes if c != "healthy")
    for i in range(len(windows)):
        turn_hz = float(windows.speed_rpm[i]) / 60
        scores = _prominences(windows.samples[i : i + 1], float(windows.fs_hz[i]), turn_hz, bearing, faults)[0]
        limit = _threshold(length, float(windows.fs_hz[i]), round(turn_hz, 1), bearing, faults, false_alarm)
        best = faults[int(scores.argmax())] if scores.max() > limit else "healthy"
        chosen[i, classes.index(best)] = 1.0
    return chosen


def _prominences(x: Array, fs_hz: float, turn_hz: float, bearing: Bearing, faults: tuple[str, ...]) -> Array:
    """Mean log prominence of the first harmonics of each fault [signals, faults]."""
    hz, values = squared_envelope_spectrum(x, fs_hz, window="hann")
    lines = Spectrum(hz / turn_hz, values)
    found = [
        np.log(lines_at(lines, bearing.fault_order(f), harmonics=HARMONICS, tolerance=TOLERANCE).prominence)
        for f in faults
    ]
    return np.stack([f[..., 0].mean(axis=-1) for f in found], axis=-1)


@lru_cache(maxsize=64)
def _threshold(
    length: int, fs_hz: float, turn_hz: float, bearing: Bearing, faults: tuple[str, ...], false_alarm: float
) -> float:
    noise = np.random.default_rng(length).standard_normal((max(200, min(1000, 2**22 // length)), length))
    return float(np.quantile(_prominences(noise, fs_hz, turn_hz, bearing, faults).max(axis=1), 1 - false_alarm))
