"""Envelopes, their spectra, and lines at fault orders.

x -> band -> analytic signal -> |.|^2 -> spectrum -> lines at fault orders

Impacts repeat at a fault order but excite a resonance far above it, so their rate is visible in the envelope only.
Source: Randall and Antoni, Rolling element bearing diagnostics: a tutorial, MSSP 25 (2011) 485,
doi:10.1016/j.ymssp.2010.07.017.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy import signal as sps

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals, band, positive, whole, without_mean
from twingap.signal.kurtosis import Band, fast_kurtogram
from twingap.signal.spectrum import Spectrum, amplitude_spectrum, nearest_bin


def analytic_signal(x: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """Analytic signal x + j H(x): negative frequencies removed, positive ones doubled.

    Parameters
    ----------
    x : array_like [..., samples]

    Returns
    -------
    complex array [..., samples]
        Its real part is x.

    Raises
    ------
    TwingapError
        For NaN, infinities or no samples.
    """
    return np.asarray(sps.hilbert(as_signals(x, where="analytic_signal"), axis=-1))


def envelope(x: ArrayLike, fs_hz: float | None = None, band_hz: tuple[float, float] | None = None) -> Array:
    """Envelope: modulus of the analytic signal, optionally of one frequency band.

    Parameters
    ----------
    x : array_like [..., samples]
    fs_hz : float, optional
        Sampling rate, Hz; required with a band.
    band_hz : (float, float), optional
        Low and high edge, Hz; None = the full band.

    Returns
    -------
    Array [..., samples]
        Unit of x.

    Raises
    ------
    TwingapError
        For NaN, infinities, a band outside 0 to half the rate.
    """
    if band_hz is None:
        return np.abs(analytic_signal(x))
    if fs_hz is None:
        raise TwingapError("a band in Hz needs the sampling rate", where="envelope", mend="give fs_hz")
    return np.abs(demodulate(x, fs_hz, band_hz))


def demodulate(
    x: ArrayLike, fs_hz: float, band_hz: tuple[float, float], *, edge: float = 0.1
) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """Analytic signal of one frequency band, without delay.

    The band is cut out of the spectrum; its edges are raised-cosine tapers inside the band, to limit ringing of
    impacts. Records are treated as periodic: an impact at one end leaks slightly to the other.

    Parameters
    ----------
    x : array_like [..., samples]
        At least 2 samples.
    fs_hz : float
        Sampling rate, Hz.
    band_hz : (float, float)
        Low and high edge, Hz, 0 <= low < high <= fs/2.
    edge : float
        Fraction of the band taken by both edges together, 0 (sharp) to 1.

    Returns
    -------
    complex array [..., samples]

    Raises
    ------
    TwingapError
        For NaN, infinities, a band out of range, or one so narrow that it holds no bin.
    """
    where = "demodulate"
    signals = as_signals(x, where=where, at_least=2)
    rate = positive(fs_hz, "fs_hz", where=where)
    low, high = band(*band_hz, rate / 2, where=where)
    if not 0 <= edge <= 1:
        raise TwingapError(f"edge = {edge!r}, a fraction 0 to 1 expected", where=where)
    samples = signals.shape[-1]
    frequency = fft.rfftfreq(samples, 1 / rate)
    inside = np.minimum(frequency - low, high - frequency) / (high - low)
    gain = np.where(inside >= 0, 1.0, 0.0)
    if edge > 0:
        gain *= np.sin(0.5 * np.pi * np.clip(inside / (edge / 2), 0, 1)) ** 2
        # A band that begins at 0 or ends at half the sampling rate has no taper there.
        flat = ((low == 0) & (frequency < (low + high) / 2)) | ((high == rate / 2) & (frequency > (low + high) / 2))
        gain[flat & (inside >= 0)] = 1.0
    if not gain.any():
        raise TwingapError(
            f"band {low:g} to {high:g} Hz holds no bin of a record of {samples} samples at {rate:g} Hz",
            where=where,
            mend="widen the band",
        )
    gain[1 : (samples + 1) // 2] *= 2.0
    spectrum = np.zeros((*signals.shape[:-1], samples), dtype=np.complex128)
    spectrum[..., : frequency.size] = fft.rfft(signals, axis=-1) * gain
    return np.asarray(fft.ifft(spectrum, axis=-1, overwrite_x=True))


def squared_envelope_spectrum(
    x: ArrayLike,
    fs_hz: float,
    band_hz: tuple[float, float] | None = None,
    *,
    normalise: bool = True,
    window: str = "boxcar",
) -> Spectrum:
    """Amplitude spectrum of the squared envelope.

    Parameters
    ----------
    x : array_like [..., samples]
        The mean is subtracted first.
    fs_hz : float
        Sampling rate, Hz.
    band_hz : (float, float), optional
        Band to demodulate, Hz; None = the full band.
    normalise : bool
        Divide by the mean squared envelope: values are then modulation depths, independent of the signal's unit. A
        carrier of amplitude 1 + m cos reads 2 m / (1 + m^2 / 2) at the modulation frequency. Zeros for a signal without
        energy in the band.
    window : str
        As in `amplitude_spectrum`.

    Returns
    -------
    Spectrum
        Hz; dimensionless, or squared unit of x. The value at 0 Hz is 0 as the mean is subtracted.

    Raises
    ------
    TwingapError
        For NaN, infinities, fewer than 2 samples, a band out of range.
    """
    signals = without_mean(as_signals(x, where="squared_envelope_spectrum", at_least=2))
    part = analytic_signal(signals) if band_hz is None else demodulate(signals, fs_hz, band_hz)
    squared = part.real**2 + part.imag**2
    if normalise:
        mean = squared.mean(axis=-1, keepdims=True)
        squared = np.divide(squared, mean, out=np.zeros_like(squared), where=mean > 0)
    return amplitude_spectrum(squared, fs_hz, window=window)


def most_impulsive_band(x: ArrayLike, fs_hz: float, *, max_level: int | None = None) -> list[Band]:
    """Band of highest kurtosis in the kurtogram of each signal.

    Parameters
    ----------
    x : array_like [..., samples]
        Leading axes are flattened.
    fs_hz : float
        Sampling rate, Hz.
    max_level : int, optional
        As in `fast_kurtogram`. A band transmits only modulations slower than its width: keep it wider than three times
        the fault frequency.

    Returns
    -------
    list of Band
        One per signal.

    Raises
    ------
    TwingapError
        As `fast_kurtogram`.
    """
    return fast_kurtogram(x, fs_hz, max_level=max_level).best


def impulsive_envelope_spectrum(
    x: ArrayLike, fs_hz: float, *, max_level: int | None = None
) -> tuple[Spectrum, list[Band]]:
    """Squared-envelope spectrum of each signal in its own most impulsive band.

    Parameters
    ----------
    x : array_like [..., samples]
    fs_hz : float
        Sampling rate, Hz.
    max_level : int, optional
        As in `fast_kurtogram`.

    Returns
    -------
    Spectrum
        Normalised, as `squared_envelope_spectrum`.
    list of Band
        The bands, one per signal (leading axes flattened).

    Raises
    ------
    TwingapError
        As `fast_kurtogram`.
    """
    signals = as_signals(x, where="impulsive_envelope_spectrum")
    bands = most_impulsive_band(signals, fs_hz, max_level=max_level)
    rows = signals.reshape(-1, signals.shape[-1])
    spectra = [squared_envelope_spectrum(r, fs_hz, (b.low_hz, b.high_hz)) for r, b in zip(rows, bands, strict=True)]
    values = np.stack([s.values for s in spectra])
    return Spectrum(spectra[0].frequency, values.reshape(*signals.shape[:-1], -1)), bands


@dataclass(frozen=True)
class Lines:
    """Lines of a spectrum at the harmonics of an order and their sidebands.

    Parameters
    ----------
    orders : Array [harmonics, 2 sidebands + 1]
        Nominal order of each line; the middle column holds the harmonics.
    found : Array [..., harmonics, 2 sidebands + 1]
        Order of the largest value within the tolerance.
    strengths : Array [..., harmonics, 2 sidebands + 1]
        The largest value within the tolerance.
    floor : Array [..., harmonics, 2 sidebands + 1]
        Median of the spectrum around the line.
    """

    orders: Array
    found: Array
    strengths: Array
    floor: Array

    @property
    def prominence(self) -> Array:
        """Strength over floor; 1 where both are 0, infinite over a floor of 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.strengths / self.floor
        return np.where(np.isnan(ratio), 1.0, ratio)


def lines_at(
    spectrum: Spectrum,
    order: float,
    *,
    harmonics: int = 3,
    sideband_order: float | None = None,
    sidebands: int = 0,
    tolerance: float = 0.02,
    floor_width: float = 0.25,
) -> Lines:
    """Lines of a fault in a spectrum: harmonics and sidebands.

    Parameters
    ----------
    spectrum : Spectrum
        Over orders, or over Hz when `order` and `sideband_order` are Hz too.
    order : float
        The fault's order (`Bearing.fault_order`), positive.
    harmonics : int
        Number of harmonics.
    sideband_order, sidebands : float, int
        Spacing and number of sidebands on either side of each: 1 for an inner race, the cage's order for a ball.
    tolerance : float
        Half width of the search around a line, relative to its order (slip shifts bearing lines by 1 to 2 %); limited
        to between half a bin and half the distance to the next sideband.
    floor_width : float
        Half width, relative to `order`, of the range whose median is the floor.

    Returns
    -------
    Lines
        Sidebands at or below 0 are NaN in `found`, `strengths` and `floor`.

    Raises
    ------
    TwingapError
        For lines beyond the spectrum or arguments out of range.
    """
    where = "lines_at"
    base = positive(order, "order", where=where)
    multiples = np.arange(1, whole(harmonics, "harmonics", where=where) + 1)
    aside = np.arange(-whole(sidebands, "sidebands", where=where, at_least=0), sidebands + 1)
    if sidebands and sideband_order is None:
        raise TwingapError("sidebands without their distance", where=where, mend="give sideband_order")
    spacing = positive(sideband_order, "sideband_order", where=where) if sideband_order is not None else 0.0
    if not 0 <= tolerance < 0.5:
        raise TwingapError(f"tolerance = {tolerance!r}, a fraction 0 <= tolerance < 0.5 expected", where=where)
    orders = multiples[:, None] * base + aside * spacing
    axis, values = spectrum
    shape = (*values.shape[:-1], *orders.shape)
    found, strengths, floor = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    for place in np.ndindex(orders.shape):
        line = float(orders[place])
        if line <= 0:
            continue
        middle = int(nearest_bin(axis, line))
        reach = tolerance * line if not sidebands else min(tolerance * line, spacing / 2)
        low, high = _stretch(axis, line, reach, middle)
        here = values[..., low:high]
        best = here.argmax(axis=-1)
        strengths[..., *place] = np.take_along_axis(here, best[..., None], axis=-1)[..., 0]
        found[..., *place] = axis[low + best]
        low, high = _stretch(axis, line, floor_width * base, middle)
        floor[..., *place] = np.median(values[..., low:high], axis=-1)
    return Lines(orders, found, strengths, floor)


def _stretch(axis: Array, line: float, reach: float, middle: int) -> tuple[int, int]:
    """Range of bins within `reach` of a line, at least the nearest one."""
    low, high = np.searchsorted(axis, (line - reach, line + reach), side="left")
    high = int(np.searchsorted(axis, line + reach, side="right"))
    return min(int(low), middle), max(high, middle + 1)
