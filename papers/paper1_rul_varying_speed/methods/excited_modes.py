"""Modes that a growing defect excites, from spectra before and after the anomaly.

Eq. 8 of paper 1 reads the one dominant mode off healthy records. What dominates those, rolling noise through a low mode
say, need not be a mode that impacts excite; the excess over them is, and it needs no label either.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks, welch

from papers.arrays import Array
from twingap import TwingapError
from twingap.effects import Mode

Samples = NDArray[np.float32]

SEGMENT_HZ = 12.0  # aimed distance of bins, Hz
_LEAST_PROMINENCE = np.log(2.0)  # of a hill over the valleys beside it, in the logarithm: what half power takes


def excess_spectrum(
    faulty: Samples, faulty_rpm: Array, healthy: Samples, healthy_rpm: Array, fs_hz: float
) -> tuple[Array, Array]:  # fmt: skip
    """Mean PSD of records [records, samples] less that of healthy ones of the nearest speed, 0 where those have more:
    frequencies, Hz, and PSD, unit squared per Hz [bins]."""
    segment = min(2 ** int(np.round(np.log2(fs_hz / SEGMENT_HZ))), faulty.shape[1], healthy.shape[1])
    f_hz, after = welch(faulty, fs_hz, nperseg=segment)
    _, before = welch(healthy, fs_hz, nperseg=segment)
    speeds = np.unique(healthy_rpm)
    floors = np.array([before[healthy_rpm == s].mean(axis=0) for s in speeds])
    near = np.abs(speeds[None] - faulty_rpm[:, None]).argmin(axis=1)
    excess = np.mean(after - floors[near], axis=0, dtype=np.float64)
    return np.asarray(f_hz, float), np.maximum(np.convolve(excess, [0.25, 0.5, 0.25], mode="same"), 0.0)


def excited_modes(
    faulty: Samples, faulty_rpm: Array, healthy: Samples, healthy_rpm: Array, fs_hz: float, count: int = 4
) -> tuple[Mode, ...]:
    """At most `count` modes that impacts ring most strongly, strongest (gain 1) first, from records [records, samples]
    after K_anomaly and healthy ones; damping from the width at half power. Raises `TwingapError` when nothing stands
    out."""
    f_hz, psd = excess_spectrum(faulty, faulty_rpm, healthy, healthy_rpm, fs_hz)
    step = float(f_hz[1])
    usable = (f_hz > 5 * step) & (f_hz < 0.45 * fs_hz)
    level = np.log(np.maximum(np.where(usable, psd, 0.0), 1e-6 * psd[usable].max() + 1e-300))
    peaks, _ = find_peaks(level, prominence=_LEAST_PROMINENCE)
    found = []
    for peak in peaks:
        low, high = (_half_power(psd, int(peak), way) for way in (-1, 1))
        # A Hann window alone is 1.44 bins wide at half power, and smoothing widens that a little.
        width = step * float(np.sqrt(max((high - low) ** 2 - 1.8**2, (0.3 * (high - low)) ** 2)))
        damping = float(np.clip(width / (2 * f_hz[peak]), 0.002, 0.3))
        # |H| of exp(-zeta w t) sin(w t) is 1 / (2 zeta w) at its peak.
        found.append((float(np.sqrt(psd[peak])) * 2 * damping * float(f_hz[peak]), float(f_hz[peak]), damping))
    if not found:
        raise TwingapError("nothing stands out of healthy records", where="excited modes", mend="wait for more records")
    found.sort(reverse=True)
    return tuple(Mode(f, zeta, gain / found[0][0]) for gain, f, zeta in found[:count])


def _half_power(psd: Array, peak: int, way: int) -> float:
    """Place (bins, interpolated) at which the hill has fallen to half, or to the valley before the next hill."""
    at, half = peak, psd[peak] / 2
    while 0 < at < psd.size - 1 and psd[at] > half:
        if psd[at + way] > psd[at] and psd[at] < 0.75 * psd[peak]:
            return float(at)
        at += way
    above, below = psd[at - way], psd[at]
    share = (above - half) / (above - below) if above > below else 0.0
    return float(at - way + way * share)
