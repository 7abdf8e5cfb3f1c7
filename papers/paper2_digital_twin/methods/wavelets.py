"""Scalograms by PyWavelets."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals, positive


def scalogram(
    x: ArrayLike, fs_hz: float, frequencies_hz: ArrayLike, *, bandwidth: float = 1.5, centre: float = 1.0
) -> Array:
    """Modulus of the continuous wavelet transform with the complex Morlet wavelet [..., frequencies, samples].

    Peak amplitude, unit of x: a tone of amplitude A reads A in its row, away from the record's ends.

    Parameters
    ----------
    x : array_like [..., samples]
        The mean is not taken out.
    frequencies_hz : array_like [frequencies]
        Above 0 and below half the rate `fs_hz`. Close to half the rate amplitudes read low, as part of the wavelet's
        band lies beyond it (2 % at 0.4 of the rate with the defaults, 38 % at 0.45).
    bandwidth, centre : float
        Of PyWavelets' ``cmorB-C``, exp(-t^2 / B) exp(2 pi j C t) / sqrt(pi B): C sqrt(B) says how many oscillations a
        wavelet holds, so more of it resolves frequency better and time worse.
    """
    import pywt

    where = "scalogram"
    signals, rate = as_signals(x, where=where), positive(fs_hz, "fs_hz", where=where)
    frequencies = as_signals(frequencies_hz, where=where)
    if frequencies.ndim != 1 or frequencies.min() <= 0 or frequencies.max() >= rate / 2:
        raise TwingapError(
            f"frequencies_hz of shape {frequencies.shape} from {frequencies.min():g} to {frequencies.max():g}, "
            f"one row between 0 and {rate / 2:g} Hz expected",
            where=where,
        )
    scales = centre * rate / frequencies
    wavelet = pywt.ContinuousWavelet(f"cmor{bandwidth!r}-{centre!r}")
    # The wavelet must have died away where PyWavelets cuts it off (at 8 by default).
    wavelet.lower_bound, wavelet.upper_bound = -(reach := math.sqrt(40 * bandwidth)), reach
    coefficients, _ = pywt.cwt(signals, scales, wavelet, method="fft", axis=-1)
    # PyWavelets divides by sqrt(scale), and takes the signal for constant between samples; a tone of frequency f then
    # reads A sqrt(scale) / 2 sinc(f / fs).
    gain = np.sqrt(scales) / 2 * np.sinc(frequencies / rate)
    values: Array = np.moveaxis(np.abs(coefficients) / gain.reshape(-1, *[1] * signals.ndim), 0, -2)
    return values
