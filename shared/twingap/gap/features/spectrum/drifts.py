"""Whether level and spectrum stay within the record, and moments that no catalogued effect has.

samples --sixteen pieces--> level: spread, slope, jump; halves --> drift of the spectrum; low band --> skewness
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.gap.features.spectrum.smooth_shape import slope_of
from twingap.signal.record_transforms import RecordView, band_medians

Array = NDArray[np.float64]

_SEGMENTS: Final = 16


def measure_drifts(view: RecordView, out: dict[str, float]) -> None:
    """Whether level and spectrum stay within the record, and moments that no catalogued effect has."""
    n = view.x.size // _SEGMENTS
    pieces = view.x[: n * _SEGMENTS].reshape(_SEGMENTS, n)
    level = 0.5 * np.log10(np.maximum(pieces.var(axis=1), 1e-300 + 1e-9 * view.mean_square))
    out["segment_spread"] = math.log10(float(level.std()) + 1e-3)
    out["segment_slope"] = slope_of(np.linspace(-0.5, 0.5, _SEGMENTS), level)
    summed = np.concatenate(([0.0], np.cumsum(level)))
    at = np.arange(3, _SEGMENTS - 2)
    jumps = summed[at] / at - (summed[-1] - summed[at]) / (_SEGMENTS - at)
    out["segment_jump"] = float(np.abs(jumps).max())
    means = pieces.mean(axis=1)
    out["segment_mean_spread"] = math.log10(float(means.std()) / math.sqrt(view.mean_square) + 1e-4)
    half = view.x.size // 2
    bands = []
    for piece in (view.x[:half], view.x[half : 2 * half]):
        spectrum = scipy.fft.rfft(piece - piece.mean())
        bands.append(np.log10(np.maximum(band_medians(spectrum.real**2 + spectrum.imag**2, 16), 1e-300)))
    change = bands[1] - bands[0]
    out["spectral_drift"] = math.log10(float(np.std(change)) + 1e-3)
    # Decimated low-pass by its bins alone; a one-sided force or a rub shows there.
    last = max(view.transform.size // 5, 16)
    low = scipy.fft.irfft(view.transform[:last], 2 * (last - 1))
    rms = float(low.std())
    if rms > 0:
        out["low_skewness"] = math.tanh(float((low * low) @ low) / low.size / rms**3)
    # Whether the high band swells with the low band's sign: a quadratic path, a bicoherence in one number.
    rest = view.transform[last : 2 * last]
    z = scipy.fft.ifft(rest, 2 * (last - 1))
    envelope = z.real**2 + z.imag**2
    spread = float(envelope.std()) * rms
    if spread > 0:
        out["level_coupling"] = float(np.mean((envelope - envelope.mean()) * low)) / spread * math.sqrt(last) / 10
