"""Reference results for comparison: guessing, and the analyst's rule on the envelope spectrum."""

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from twingap import Bearing
from twingap.adapt import Windows
from twingap.signal import Spectrum, lines_at, most_impulsive_band, squared_envelope_spectrum

Read = Literal["whole", "impulsive"]
HARMONICS = 2
TOLERANCE = 0.02  # bearings slip by up to a per cent or two


def majority(labels: NDArray[np.int64], n_classes: int) -> float:
    """Accuracy of calling everything the class that is most frequent among the windows judged."""
    return float(np.bincount(labels, minlength=n_classes).max() / labels.size)


def analyst(
    windows: Windows, bearing: Bearing, classes: tuple[str, ...], false_alarm: float, band: Read = "whole"
) -> Array:
    """The analyst's rule: the fault whose order stands out most in the squared-envelope spectrum, or healthy [windows,
    classes], one-hot.

    `false_alarm` is the share of simulated white-noise windows that the rule calls faulty; no record is looked at for
    that. `band` "whole" demodulates all of each window, "impulsive" the band of its kurtogram with the highest
    kurtosis, at least three times as wide as the highest fault frequency.
    """
    length = windows.samples.shape[1]
    # Recordings of almost equal length share a threshold: simulating theirs takes seconds.
    length = length if length < 20_000 else round(length, 2 - len(str(length)))
    chosen = np.zeros((len(windows), len(classes)))
    faults = tuple(c for c in classes if c != "healthy")
    for i in range(len(windows)):
        turn_hz = float(windows.speed_rpm[i]) / 60
        scores = _prominences(windows.samples[i : i + 1], float(windows.fs_hz[i]), turn_hz, bearing, faults, band)[0]
        limit = _threshold(length, float(windows.fs_hz[i]), round(turn_hz, 1), bearing, faults, false_alarm, band)
        best = faults[int(scores.argmax())] if scores.max() > limit else "healthy"
        chosen[i, classes.index(best)] = 1.0
    return chosen


def _prominences(
    x: Array, fs_hz: float, turn_hz: float, bearing: Bearing, faults: tuple[str, ...], band: Read
) -> Array:
    """Mean log prominence of the first harmonics of each fault [signals, faults]."""
    if band == "whole":
        hz, values = squared_envelope_spectrum(x, fs_hz, window="hann")
    else:
        widest = fs_hz / 2 / (3 * turn_hz * max(bearing.fault_order(f) for f in faults))
        level = max(1, min(math.floor(math.log2(widest)), math.floor(math.log2(x.shape[1])) - 7))
        bands = most_impulsive_band(x, fs_hz, max_level=level)
        each = [
            squared_envelope_spectrum(row, fs_hz, (b.low_hz, b.high_hz), window="hann")
            for row, b in zip(x, bands, strict=True)
        ]
        hz, values = each[0].frequency, np.stack([s.values for s in each])
    lines = Spectrum(hz / turn_hz, values)
    found = [
        np.log(lines_at(lines, bearing.fault_order(f), harmonics=HARMONICS, tolerance=TOLERANCE).prominence)
        for f in faults
    ]
    return np.stack([f[..., 0].mean(axis=-1) for f in found], axis=-1)


@lru_cache(maxsize=64)
def _threshold(
    length: int, fs_hz: float, turn_hz: float, bearing: Bearing, faults: tuple[str, ...], false_alarm: float, band: Read
) -> float:
    noise = np.random.default_rng(length).standard_normal((max(200, min(1000, 2**22 // length)), length))
    return float(np.quantile(_prominences(noise, fs_hz, turn_hz, bearing, faults, band).max(axis=1), 1 - false_alarm))
