"""Features of impulsive noise: number and level of impulses at random times, and their ring-down.

record without tones --whitened--> peaks above noise and above a fault's impacts --> rate, level, frequency, damping

Source: Borghesani & Antoni 2017 (impulsive background).
"""

from __future__ import annotations

import math

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.signal import find_peaks

from twingap.effects.impulsive_noise import LEAST_RATE_HZ
from twingap.gap.features.spectrum.smooth_shape import bump
from twingap.gap.features.spectrum.without_tones import without_tones
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, medians


def measure_impulsive_noise(record: RecordTransforms, smooth: Array, out: dict[str, float]) -> None:
    """Fill the features of impulses: peaks of the whitened record above noise and above the impacts of a fault."""
    n, fs_hz = record.x.size, record.fs_hz
    root = np.sqrt(np.maximum(smooth, 1e-6 * float(smooth.mean()) + 1e-300))
    gain = 1 / np.interp(np.arange(record.transform.size), (np.arange(512) + 0.5) * (record.transform.size / 512), root)
    # Tones make peaks too: their bins are reduced to the floor.
    white = without_tones(record).transform * gain
    w = scipy.fft.irfft(white, n)
    size = np.abs(w)
    sigma = float(medians(size)) / 0.6745
    if sigma <= 0:
        return
    square = w * w
    out["white_kurtosis_log"] = math.log10(max(float(square @ square) * n / float(square.sum()) ** 2 / 3, 1e-6))
    threshold = 5.5 * sigma
    if record.fault_order is not None:
        period = int(np.clip(fs_hz / max(record.fault_order * record.shaft_hz, 1e-6), 8, n // 8))
        peaks = size[: n // period * period].reshape(-1, period).max(axis=1)
        middle = float(medians(peaks))
        threshold = max(threshold, middle + max(6 * float(medians(np.abs(peaks - middle))), 0.5 * middle))
    out["impulse_peak_log"] = math.log10(float(size.max()) / threshold)
    apart = max(int(0.004 * fs_hz), 1)
    at = np.empty(0, np.int64)
    if size.max() >= threshold:
        # Samples below the threshold are zeroed first, which makes the search faster.
        at = find_peaks(np.where(size >= threshold, size, 0.0), height=threshold, distance=apart)[0]
    count = at.size
    out["impulse_count_log"] = math.log10(count / record.duration_s + LEAST_RATE_HZ)
    rate = count / record.duration_s
    if count:
        # Exponential strengths have no memory: the mean excess over the threshold is the mean strength.
        excess = float(size[at].mean()) - threshold
        rate *= math.exp(min(threshold / max(excess, 0.2 * threshold), 3.0)) if count >= 2 else 1.0
        reach = max(int(0.002 * fs_hz), 2)
        around = np.clip(at[:, None] + np.arange(-reach, reach), 0, n - 1)
        x = record.centred
        raw = np.abs(x[around]).max(axis=1)
        share = max(excess / max(float(size[at].mean()), 1e-300), 0.2)
        out["impulse_level"] = math.log10(max(float(raw.mean()) * share, 1e-300) / max(record.frame.scale, 1e-300))
        _ring_down(record, x, at, out)
    out["impulse_rate_log"] = math.log10(rate + LEAST_RATE_HZ)


def _ring_down(record: RecordTransforms, x: Array, at: NDArray[np.int64], out: dict[str, float]) -> None:
    """Frequency and damping of the ring-down after the strongest impulses, above the background spectrum."""
    length = 256
    strongest = at[np.argsort(np.abs(x[at]))[::-1][:8]]
    strongest = strongest[strongest + length <= x.size]
    if strongest.size == 0:
        return
    begin = np.maximum(strongest - 4, 0)
    pieces = x[begin[:, None] + np.arange(length)]
    power = (np.abs(scipy.fft.rfft(pieces, 1024, axis=1)) ** 2).sum(axis=0)
    background = float(medians(power))
    power = np.maximum(power - background, 0.0)
    power[:4] = 0.0
    height, place, width = bump(power)
    if height <= 0:
        return
    out["impulse_fs"] = place / 1024
    out["impulse_hz_log"] = math.log10(max(place, 1) / 1024 * record.fs_hz)
    out["impulse_damping_log"] = math.log10(width / 2 / max(place, 1))
