"""Levels of windows above the quietest recording of their fleet, by frequency band.

windows --> ln power in bands --minus the minimum over recordings at that speed--> levels above the quietest

A defect adds vibration. The level of the healthy machine is unknown, but the quietest recording in a band is an upper
bound, provided that all were measured in the same way. Where all recordings are faulty the levels are too low, and with
a single recording they are about 0. Training fleets therefore have any fraction of healthy machines and any size.
"""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.windows import Windows

Array = NDArray[np.float64]

BANDS: Final = 8
"""Number of bands; more resolve modes better and are noisier."""
LOWEST: Final = 0.02
"""Lower end of the lowest band, relative to half the sampling rate."""
APART: Final = 0.03
"""Relative difference of speeds of different operating points; larger merges more speeds."""
NAMES: Final = (
    "highest", "mean", "third lowest", "fifth lowest", "seventh lowest",
    "highest over the quietest", "mean over the quietest", "furthest from the quietest",
    *(f"band {k + 1}" for k in range(BANDS)), "all",
)  # fmt: skip


def band_levels(windows: Windows) -> Array:
    """Mean ln power density in bands of equal ratio up to half the sampling rate, and ln of the total power.

    The mean of logarithms describes the noise, since a tone in the band hardly changes it. Unit: ln of the squared
    unit.

    Returns
    -------
    Array [windows, BANDS + 1]
    """
    x = windows.samples - windows.samples.mean(axis=1, keepdims=True)
    power = np.abs(np.fft.rfft(x * np.hanning(x.shape[1]), axis=1)) ** 2
    n = power.shape[1]
    edges = np.round(np.geomspace(LOWEST * n, n, BANDS + 1)).astype(int)
    noise = [np.log(power[:, low:high] + 1e-30).mean(axis=1) for low, high in itertools.pairwise(edges)]
    return np.column_stack([*noise, np.log(power.sum(axis=1) + 1e-30)])


def levels_above_the_quietest(windows: Windows) -> Array:
    """Levels of each window, in the order of `NAMES`, relative to the recordings of its fleet at a similar speed.

    Parameters
    ----------
    windows : Windows
        Windows of one fleet: the same kind of machine and sensor. `group` is the recording; labels are not used.

    Returns
    -------
    Array [windows, features]
        In nepers of power.
    """
    own = band_levels(windows)
    out = np.empty((len(windows), len(NAMES)))
    point = operating_points(windows.speed_rpm)
    for number in range(int(point.max(initial=-1)) + 1):
        at = np.flatnonzero(point == number)
        out[at] = _above(own[at], windows.group[at])
    return out


def operating_points(speed_rpm: Array) -> NDArray[np.int64]:
    """Index of the operating point of each window: sorted speeds, split at large steps."""
    order = np.argsort(speed_rpm, kind="stable")
    jumps = np.diff(speed_rpm[order]) > APART * speed_rpm[order][:-1]
    point = np.empty(len(speed_rpm), dtype=np.int64)
    point[order] = np.concatenate(([0], np.cumsum(jumps))) if len(speed_rpm) else []
    return point


def _above(level: Array, group: NDArray[np.str_]) -> Array:
    of_recording = np.stack([np.median(level[group == g], axis=0) for g in dict.fromkeys(group)])
    least = of_recording.min(axis=0)
    above = level - least
    # The recording closest to the minimum: a healthy one if there is any.
    quietest = level - of_recording[(of_recording - least).sum(axis=1).argmin()]
    ranked = np.sort(above[:, :-1], axis=1)[:, [2, 4, 6]]
    return np.column_stack([
        above.max(axis=1), above.mean(axis=1), ranked,
        quietest.max(axis=1), quietest.mean(axis=1), np.abs(quietest).max(axis=1), above,
    ])  # fmt: skip
