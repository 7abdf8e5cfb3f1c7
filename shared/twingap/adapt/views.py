"""Network inputs from windows: the waveform, or spectra without what differs between machines.

samples [windows, length] --view--> input [windows, 1, points], float32

None of these looks at a label, and each treats simulated and measured windows alike.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.windows import Windows
from twingap.errors import TwingapError
from twingap.signal.envelope import squared_envelope_spectrum

Array = NDArray[np.float64]

ORDERS: Final[Array] = np.linspace(0.5, 20.0, 512)
"""Shaft orders at which envelope spectra are read: four harmonics of the 6205's outer race, three of its inner."""


def waveform(windows: Windows) -> Array:
    """Mean taken out, scaled to unit variance: amplitudes of another machine do not compare."""
    x = windows.samples - windows.samples.mean(axis=1, keepdims=True)
    return np.asarray(x / np.maximum(x.std(axis=1, keepdims=True), 1e-12))


def spectrum(windows: Windows) -> Array:
    """Logarithm of the amplitude spectrum, standardised per window."""
    x = waveform(windows)
    amplitude = np.abs(np.fft.rfft(x * np.hanning(x.shape[1]), axis=1))[:, 1:]
    level = np.log(amplitude + 1e-3 * amplitude.mean(axis=1, keepdims=True) + 1e-9)
    return np.asarray((level - level.mean(axis=1, keepdims=True)) / np.maximum(level.std(axis=1, keepdims=True), 1e-9))


def envelope_spectrum(windows: Windows) -> Array:
    """Squared-envelope spectrum of the whole band over shaft orders, as ln(1 + amplitude over its median).

    The orders of bearing faults stay where they are whatever structure rings, at whatever speed.
    """
    return _over_orders(waveform(windows), windows)


def whitened_envelope_spectrum(windows: Windows) -> Array:
    """The same after cepstral prewhitening: every frequency gets the same amplitude, only phase is kept.

    Removes resonances and tones alike (Borghesani et al. 2013, DOI 10.1016/j.ymssp.2012.11.001; used on the CWRU
    records by Smith and Randall 2015, DOI 10.1016/j.ymssp.2015.04.021).
    """
    return _over_orders(prewhitened(waveform(windows)), windows)


def prewhitened(x: Array) -> Array:
    """Cepstral prewhitening [signals, samples]: the same amplitude at every frequency, the signals' own phases."""
    transform = np.fft.rfft(x, axis=1)
    flat = transform / np.maximum(np.abs(transform), 1e-12)
    flat[:, 0] = 0.0
    return np.asarray(np.fft.irfft(flat, x.shape[1], axis=1))


def _over_orders(x: Array, windows: Windows) -> Array:
    rows = np.empty((len(windows), ORDERS.size))
    for rate in np.unique(windows.fs_hz):
        chosen = np.flatnonzero(windows.fs_hz == rate)
        lines = squared_envelope_spectrum(x[chosen], float(rate), window="hann")
        for place, values in zip(chosen, lines.values, strict=True):
            order = lines.frequency / (windows.speed_rpm[place] / 60)
            band = (order >= ORDERS[0]) & (order <= ORDERS[-1])
            floor = np.median(values[band]) if band.any() else 0.0
            rows[place] = np.log1p(np.interp(ORDERS, order, values) / max(float(floor), 1e-12))
    return rows


VIEWS: Final[dict[str, Callable[[Windows], Array]]] = {
    "waveform": waveform,
    "spectrum": spectrum,
    "envelope_spectrum": envelope_spectrum,
    "whitened_envelope_spectrum": whitened_envelope_spectrum,
}
"""Inputs by name."""


def inputs(windows: Windows, view: str) -> NDArray[np.float32]:
    """Network input [windows, 1, points].

    Raises
    ------
    TwingapError
        For an unknown view.
    """
    if view not in VIEWS:
        raise TwingapError(f"unknown input {view!r}", mend=f"use one of {', '.join(VIEWS)}")
    return VIEWS[view](windows)[:, None, :].astype(np.float32)
