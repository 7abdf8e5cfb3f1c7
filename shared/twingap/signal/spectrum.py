"""Spectra with defined scalings.

amplitude_spectrum        one-sided, peak amplitude in the unit of x: a sine of amplitude A on a bin reads A
averaged_spectrum         the same, root of the mean square over overlapping segments: phase-free, less scatter
power_spectral_density    one-sided density in unit^2/Hz: its integral is the variance (Welch 1967)

The mean of a signal is subtracted first in all three. Values at 0 Hz and at half the sampling rate, which have no
counterpart at a negative frequency, are not doubled.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy import signal as sps

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals, positive, whole


class Spectrum(NamedTuple):
    """Values at equally spaced frequencies or orders; unpacks as ``frequency, values``.

    Parameters
    ----------
    frequency : Array [bins]
        Ascending from 0, in Hz, or in multiples of shaft speed where the function says so.
    values : Array [..., bins]
    """

    frequency: Array
    values: Array

    @property
    def resolution(self) -> float:
        """Bin spacing, in the unit of `frequency`."""
        return float(self.frequency[1] - self.frequency[0])

    def at(self, frequency: ArrayLike) -> Array:
        """Values at the bins nearest to these frequencies, `[..., *frequency.shape]`."""
        values: Array = self.values[..., nearest_bin(self.frequency, frequency)]
        return values

    def in_orders(self, speed_rpm: float) -> Spectrum:
        """The same values over multiples of a constant shaft speed; for a spectrum in Hz."""
        return Spectrum(self.frequency / (positive(speed_rpm, "speed_rpm", where="in_orders") / 60), self.values)


def nearest_bin(frequency: ArrayLike, wanted: ArrayLike) -> NDArray[np.intp]:
    """Index of the bin nearest to each wanted frequency or order; on a tie the lower one.

    Parameters
    ----------
    frequency : array_like [bins]
        Bins, equally spaced and ascending.
    wanted : array_like [...]
        In the unit of `frequency`.

    Returns
    -------
    int array [...]

    Raises
    ------
    TwingapError
        For NaN, or a frequency more than half a bin outside the range of the bins.
    """
    bins, requested = np.asarray(frequency, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    if bins.ndim != 1 or bins.size < 2:
        raise TwingapError(f"bins of shape {bins.shape}, at least two in a row expected", where="nearest_bin")
    step = (bins[-1] - bins[0]) / (bins.size - 1)
    place = (requested - bins[0]) / step
    inside = (place >= -0.5) & (place <= bins.size - 0.5)
    if not inside.all():
        outside = requested[~inside].flat[0]
        raise TwingapError(
            f"{outside:g} lies outside the spectrum, {bins[0]:g} to {bins[-1]:g}",
            where="nearest_bin",
            mend="sample faster, or use fewer harmonics",
        )
    nearest: NDArray[np.intp] = np.clip(np.ceil(place - 0.5).astype(np.intp), 0, bins.size - 1)
    return nearest


def amplitude_spectrum(x: ArrayLike, fs_hz: float, *, window: str = "hann") -> Spectrum:
    """One-sided amplitude spectrum of whole records.

    Parameters
    ----------
    x : array_like [..., samples]
        At least 2 samples.
    fs_hz : float
        Sampling rate, Hz; samples per turn for a spectrum over orders.
    window : str
        Any window of `scipy.signal.get_window` without parameters, periodic form; divided by its mean, so that lines
        keep their amplitude. Between bins a line reads up to 15 % low with "hann", 36 % with "boxcar", 0.1 % with
        "flattop".

    Returns
    -------
    Spectrum
        Hz; peak amplitude, unit of x.

    Raises
    ------
    TwingapError
        For NaN, infinities, too few samples, an unknown window.
    """
    signals = as_signals(x, where="amplitude_spectrum", at_least=2)
    rate = positive(fs_hz, "fs_hz", where="amplitude_spectrum")
    samples = signals.shape[-1]
    weights = _window(window, samples, "amplitude_spectrum")
    centred = signals - signals.mean(axis=-1, keepdims=True)
    values = np.abs(fft.rfft(centred * (weights / weights.sum()), axis=-1))
    values[..., 1 : (samples + 1) // 2] *= 2.0
    return Spectrum(fft.rfftfreq(samples, 1 / rate), values)


def averaged_spectrum(
    x: ArrayLike, fs_hz: float, *, segment_samples: int, overlap: float = 0.5, window: str = "hann"
) -> Spectrum:
    """Amplitude spectrum, root mean square over the segments of each record.

    Parameters
    ----------
    x : array_like [..., samples]
    fs_hz : float
        Sampling rate, Hz.
    segment_samples : int
        Length of a segment, at most that of the record.
    overlap : float
        Fraction shared by neighbouring segments, 0 <= overlap < 1.
    window : str
        As in `amplitude_spectrum`.

    Returns
    -------
    Spectrum
        Hz; peak amplitude, unit of x.

    Raises
    ------
    TwingapError
        As `amplitude_spectrum`; also for segments longer than the record.
    """
    frequency, power = _welch(x, fs_hz, segment_samples, overlap, window, "spectrum", "averaged_spectrum")
    # SciPy's mean square of a line is half the squared peak, but all of it at 0 and at half the sampling rate.
    power[..., 1 : (segment_samples + 1) // 2] *= 2.0
    return Spectrum(frequency, np.sqrt(power))


def power_spectral_density(
    x: ArrayLike, fs_hz: float, *, segment_samples: int, overlap: float = 0.5, window: str = "hann"
) -> Spectrum:
    """One-sided power spectral density by Welch's method, with SciPy.

    Parameters
    ----------
    x, fs_hz, segment_samples, overlap, window
        As `averaged_spectrum`.

    Returns
    -------
    Spectrum
        Hz; unit of x squared per Hz.

    Raises
    ------
    TwingapError
        As `averaged_spectrum`.
    """
    return Spectrum(*_welch(x, fs_hz, segment_samples, overlap, window, "density", "power_spectral_density"))


def segments_of(samples: int, segment_samples: int, overlap: float, *, where: str) -> tuple[int, int]:
    """Segment length and overlap in samples, checked against the record's length."""
    length = whole(segment_samples, "segment_samples", where=where, at_least=2)
    if length > samples:
        raise TwingapError(
            f"segment_samples = {length}, but records have {samples}", where=where, mend="use shorter segments"
        )
    if not 0 <= overlap < 1:
        raise TwingapError(f"overlap = {overlap!r}, a fraction 0 <= overlap < 1 expected", where=where)
    return length, min(round(overlap * length), length - 1)


def _window(name: str, samples: int, where: str) -> Array:
    try:
        weights: Array = sps.get_window(name, samples).astype(np.float64)
    except ValueError:
        raise TwingapError(
            f"window = {name!r}", where=where, mend="use hann, hamming, blackman, flattop, boxcar"
        ) from None
    return weights


def _welch(
    x: ArrayLike,
    fs_hz: float,
    segment_samples: int,
    overlap: float,
    window: str,
    scaling: Literal["density", "spectrum"],
    where: str,
) -> tuple[Array, Array]:
    signals = as_signals(x, where=where, at_least=2)
    rate = positive(fs_hz, "fs_hz", where=where)
    length, shared = segments_of(signals.shape[-1], segment_samples, overlap, where=where)
    _window(window, length, where)
    centred = signals - signals.mean(axis=-1, keepdims=True)
    return sps.welch(centred, rate, window, length, shared, detrend=False, scaling=scaling, axis=-1)
