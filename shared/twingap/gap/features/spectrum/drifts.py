"""Features of changes within a record, and of moments that no catalogued effect changes.

samples --sixteen pieces--> level: spread, slope, jump; halves --> drift of the spectrum; low band --> skewness
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import scipy.fft

from twingap.gap.features.spectrum.smooth_shape import slope_of
from twingap.signal.record_transforms import RecordTransforms, band_medians

_SEGMENTS: Final = 16
"""Pieces of a record: more show shorter changes with more noise."""


def measure_drifts(record: RecordTransforms, out: dict[str, float]) -> None:
    """Fill the features of changes within the record, and of moments that no catalogued effect changes."""
    n = record.x.size // _SEGMENTS
    pieces = record.x[: n * _SEGMENTS].reshape(_SEGMENTS, n)
    level = 0.5 * np.log10(np.maximum(pieces.var(axis=1), 1e-300 + 1e-9 * record.mean_square))
    out["segment_spread"] = math.log10(float(level.std()) + 1e-3)
    out["segment_slope"] = slope_of(np.linspace(-0.5, 0.5, _SEGMENTS), level)
    summed = np.concatenate(([0.0], np.cumsum(level)))
    at = np.arange(3, _SEGMENTS - 2)
    jumps = summed[at] / at - (summed[-1] - summed[at]) / (_SEGMENTS - at)
    out["segment_jump"] = float(np.abs(jumps).max())
    means = pieces.mean(axis=1)
    out["segment_mean_spread"] = math.log10(float(means.std()) / math.sqrt(record.mean_square) + 1e-4)
    half = record.x.size // 2
    bands = []
    for piece in (record.x[:half], record.x[half : 2 * half]):
        spectrum = scipy.fft.rfft(piece - piece.mean())
        bands.append(np.log10(np.maximum(band_medians(spectrum.real**2 + spectrum.imag**2, 16), 1e-300)))
    change = bands[1] - bands[0]
    out["spectral_drift"] = math.log10(float(np.std(change)) + 1e-3)
    # Decimated low-pass by its bins alone; a one-sided force or a rub shows there.
    last = max(record.transform.size // 5, 16)
    low = scipy.fft.irfft(record.transform[:last], 2 * (last - 1))
    rms = float(low.std())
    if rms > 0:
        out["low_skewness"] = math.tanh(float((low * low) @ low) / low.size / rms**3)
    # Correlation of the high band's power with the low band's sign: a quadratic path (bicoherence in one number).
    rest = record.transform[last : 2 * last]
    z = scipy.fft.ifft(rest, 2 * (last - 1))
    envelope = z.real**2 + z.imag**2
    spread = float(envelope.std()) * rms
    if spread > 0:
        out["level_coupling"] = float(np.mean((envelope - envelope.mean()) * low)) / spread * math.sqrt(last) / 10
