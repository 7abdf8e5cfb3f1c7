"""Transforms of one record that its measurements share, each computed once.

Frame (bearing, band, scale) + samples + condition --> RecordTransforms: periodogram, smooth spectrum, squared envelope
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, wraps
from typing import Final, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from twingap.bearing import Bearing
from twingap.records import Condition

Array = NDArray[np.float64]
Value = TypeVar("Value")

SMOOTH_SEGMENTS: Final = 512
"""Bins of the smooth spectrum between 0 and half the sampling rate; more resolve sharper modes with more noise."""


@dataclass(frozen=True)
class Frame:
    """Bearing, band and amplitude scale of a comparison, the same for measured and simulated records.

    Parameters
    ----------
    bearing : Bearing
        Bearing under test.
    band_hz : (float, float)
        Band excited by impacts, Hz: the default band of envelopes.
    scale : float
        RMS of the machine's healthy vibration, in the unit of the records: the scale of amplitudes.
    """

    bearing: Bearing
    band_hz: tuple[float, float]
    scale: float


class Envelope:
    """Squared envelope of one band, sampled no faster than the band needs.

    Attributes
    ----------
    values : Array [m]
        Squared envelope |analytic signal|^2, in the unit of the records squared.
    fs_hz : float
        Sampling rate of `values`, Hz.
    """

    def __init__(self, values: Array, fs_hz: float) -> None:
        self.values, self.fs_hz = values, fs_hz

    @cached_property
    def mean(self) -> float:
        """Mean squared envelope: twice the power in the band."""
        return float(self.values.mean())

    @cached_property
    def spectrum(self) -> Array:
        """[m // 2 + 1] Periodogram (Hann) of the squared envelope over its mean, dimensionless power per bin.

        A modulation 1 + d cos is a line of d^2 / 2, whatever the length; the noise floor falls with the length.
        """
        swing = self.values / max(self.mean, 1e-300)
        swing -= 1.0
        return tone_power(swing)

    @property
    def df_hz(self) -> float:
        """Bin spacing of `spectrum`, Hz."""
        return self.fs_hz / self.values.size


class RecordTransforms:
    """A record and its transforms, each computed on first use.

    Parameters
    ----------
    samples : Array [n]
        In the unit of the records.
    condition : Condition
        With the best estimate of the speed.
    frame : Frame

    Attributes
    ----------
    x : Array [n]
        The samples without changes.
    shaft_hz, fs_hz, duration_s : float
        Shaft rate, Hz; sampling rate, Hz; length, s.
    fault_order : float or None
        Impacts per shaft turn at the kinematic orders; None for a healthy record or an unknown fault.
    """

    def __init__(self, samples: Array, condition: Condition, frame: Frame) -> None:
        self.x = np.asarray(samples, dtype=float)
        self.condition, self.frame, self.bearing = condition, frame, frame.bearing
        self.fs_hz, self.duration_s = condition.fs_hz, condition.duration_s
        self.shaft_hz = condition.speed_rpm / 60
        self._envelopes: dict[tuple[float, float], Envelope] = {}
        known = condition.fault not in (None, "healthy")
        self.fault_order = frame.bearing.fault_order(str(condition.fault)) if known else None

    @cached_property
    def transform(self) -> NDArray[np.complex128]:
        """[n // 2 + 1] rfft of the samples minus their mean, no window."""
        return np.asarray(self._transforms[0])

    @cached_property
    def _transforms(self) -> NDArray[np.complex128]:
        """[2, n // 2 + 1] rfft of the samples minus their mean, without and with a Hann window: faster as a pair."""
        pair = np.empty((2, self.x.size))
        pair[0] = self.centred
        np.multiply(self.centred, _hann(self.x.size), out=pair[1])
        return np.asarray(scipy.fft.rfft(pair))

    @cached_property
    def centred(self) -> Array:
        """[n] The samples minus their mean."""
        return np.asarray(self.x - self.x.mean())

    @property
    def df_hz(self) -> float:
        """Bin spacing of `transform` and `tones`, Hz."""
        return self.fs_hz / self.x.size

    @cached_property
    def tones(self) -> Array:
        """[n // 2 + 1] Power spectrum (Hann) scaled for tones: a sine of amplitude a has a peak of a^2 / 2, unit^2."""
        return _tone_power(self._transforms[1], self.x.size)

    def tones_between(self) -> Array:
        """[n // 2 + 1] `tones` at the frequencies half a bin above its own, unit^2."""
        padded = scipy.fft.rfft(self.centred * _hann(self.x.size), 2 * self.x.size)
        return _tone_power(np.append(padded[1::2], 0.0)[: self.x.size // 2 + 1], self.x.size)

    @cached_property
    def smooth(self) -> Array:
        """[SMOOTH_SEGMENTS] One-sided power density between 0 and fs / 2 with tones removed, unit^2 / Hz.

        The median of the periodogram within each of equal bands, made unbiased for Gaussian noise.
        """
        power = (self.transform.real**2 + self.transform.imag**2) * (2 / (self.fs_hz * self.x.size))
        return np.asarray(band_medians(power[1:], SMOOTH_SEGMENTS) / np.log(2), float)

    @cached_property
    def mean_square(self) -> float:
        """Mean square about the mean, unit squared."""
        return float(self.centred @ self.centred) / max(self.x.size, 1)

    @cached_property
    def envelope(self) -> Envelope:
        """Squared envelope in the frame's band."""
        return self.envelope_in(*self.frame.band_hz)

    def envelope_in(self, low_hz: float, high_hz: float) -> Envelope:
        """Squared envelope of a band, by the inverse transform of its bins alone; cached by band.

        The analytic signal of a band of B Hz is sampled at 2 B (its square has a bandwidth of B), so that narrow bands
        are cheap.
        """
        found = self._envelopes.get((low_hz, high_hz))
        if found is None:
            found = self._envelopes[low_hz, high_hz] = self._envelope_in(low_hz, high_hz)
        return found

    def _envelope_in(self, low_hz: float, high_hz: float) -> Envelope:
        z = self.band[0] if (low_hz, high_hz) == self.frame.band_hz else self._analytic(low_hz, high_hz)[0]
        squared = z.real**2
        squared += z.imag**2
        squared *= (2 * z.size / self.x.size) ** 2
        return Envelope(squared, z.size * self.df_hz)

    @cached_property
    def band(self) -> tuple[NDArray[np.complex128], int]:
        """Analytic signal [m] of the frame's band over 2 m / n, shifted down to 0, and the bin shifted to 0."""
        return self._analytic(*self.frame.band_hz)

    def _analytic(self, low_hz: float, high_hz: float) -> tuple[NDArray[np.complex128], int]:
        half = self.x.size // 2
        first = min(max(math.floor(min(low_hz / self.df_hz, half)), 1), max(half - 2, 1))
        last = min(max(math.ceil(min(high_hz / self.df_hz, half)), first + 1), half)
        own = self.transform[first:last]
        m = scipy.fft.next_fast_len(2 * own.size)
        padded = np.zeros(m, complex)
        np.multiply(own, taper(own.size, max(own.size // 16, 1)), out=padded[: own.size])
        return np.asarray(scipy.fft.ifft(padded, overwrite_x=True)), first


def once_a_record(measure: Callable[[RecordTransforms], Value]) -> Callable[[RecordTransforms], Value]:
    """Decorator of a function of one record: its result is kept as long as the record is."""
    known: WeakKeyDictionary[RecordTransforms, Value] = WeakKeyDictionary()

    @wraps(measure)
    def kept(record: RecordTransforms) -> Value:
        if record not in known:
            known[record] = measure(record)
        return known[record]

    return kept


@lru_cache(maxsize=32)
def taper(size: int, edge: int) -> Array:
    """[size] Window with a flat top and raised-cosine edges, which limit ringing."""
    window, ramp = np.ones(size), 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    window[:edge], window[-edge:] = ramp, ramp[::-1]
    return window


def tone_power(x: Array) -> Array:
    """[n // 2 + 1] Hann power spectrum in which a sine of amplitude a has a peak of a^2 / 2."""
    windowed = x - x.mean()
    windowed *= _hann(x.size)
    return _tone_power(scipy.fft.rfft(windowed), x.size)


def tone_spectrum(x: Array) -> NDArray[np.complex128]:
    """[n // 2 + 1] Hann spectrum whose squared magnitude is `tone_power`."""
    return np.asarray(scipy.fft.rfft((x - x.mean()) * _hann(x.size)) * (math.sqrt(8) / x.size))


def _tone_power(spectrum: NDArray[np.complex128], size: int) -> Array:
    power = spectrum.real**2
    power += spectrum.imag**2
    power *= 8 / size**2  # the window's sum is n / 2
    return np.asarray(power)


def medians(values: Array) -> Array:
    """[...] Medians over the last axis [..., n] of finite numbers.

    Faster than `np.median`, which also checks for NaN; few numbers are sorted faster than they are partitioned.
    """
    middle, odd = divmod(values.shape[-1], 2)
    if values.shape[-1] <= 64:
        parted = np.sort(values, axis=-1)
    else:
        parted = np.partition(values, middle if odd else (middle - 1, middle), axis=-1)
    return np.asarray(parted[..., middle] if odd else 0.5 * (parted[..., middle - 1] + parted[..., middle]))


def mean_of_five(values: Array) -> Array:
    """[n] Mean of each value and its two neighbours on either side; the ends are repeated."""
    return np.convolve(np.pad(values, 2, mode="edge"), np.full(5, 0.2), "valid")


def between_blocks(levels: Array, width: int, size: int, shift: float = 0.0) -> Array:
    """[size] Levels of blocks of `width` bins each, interpolated between their middles, constant beyond the outer ones.

    The middle of a block is its bin width // 2 less `shift` bins.
    """
    out, half, last = np.empty(size), width // 2, (len(levels) - 1) * width
    out[:half], out[half + last :] = levels[0], levels[-1]
    steps = (np.diff(levels) / width)[:, None] * (np.arange(width) + shift)
    np.add(levels[:-1, None], steps, out=out[half : half + last].reshape(-1, width))
    return out


def known_medians(values: Array) -> Array:
    """[columns] Medians of the numbers in each column of values [rows, columns]; NaN where all are NaN.

    Equal to `np.nanmedian` and several times as fast for few rows.
    """
    ordered = np.sort(values, axis=0)  # NaN last
    count = (~np.isnan(values)).sum(axis=0)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    columns = np.arange(values.shape[1])
    both = ordered[low, columns] + ordered[np.minimum(high, len(values) - 1), columns]
    return np.where(count > 0, 0.5 * both, np.nan)


def band_medians(power: Array, count: int) -> Array:
    """[count] Medians within `count` equal bands that cover a spectrum [bins] exactly.

    Bands need not hold a whole number of bins, so that a band has the same frequencies for any record length.
    """
    return medians(power[_band_places(power.size, count)])


@lru_cache(maxsize=32)
def _band_places(size: int, count: int) -> NDArray[np.int64]:
    """[count, bins of a band] Indices of the bins in each band."""
    width = size / count
    per = max(int(np.ceil(width)), 1)
    inner = (np.arange(per) + 0.5) / per
    at = ((np.arange(count)[:, None] + inner) * width).astype(int)
    return np.asarray(np.minimum(at, size - 1))


def local_floor(power: Array, width: int = 101) -> Array:
    """[bins] Running median of a periodogram: the level between its lines. Every eighth bin, interpolated between."""
    step = 8 if power.size > 16 * width else 1
    coarse = median_filter(power, size=min(width, power.size), mode="nearest") if step == 1 else None
    if coarse is not None:
        return np.asarray(coarse)
    half, places = width // 2, np.arange(0, power.size, step)
    padded = np.concatenate((power[half:0:-1], power, power[-2 : -half - 2 : -1]))  # reflected
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)[::step]
    return np.asarray(np.interp(np.arange(power.size), places[: len(windows)], medians(windows)))


_WINDOWS: dict[int, Array] = {}


def _hann(n: int) -> Array:
    if n not in _WINDOWS:
        if len(_WINDOWS) > 32:
            _WINDOWS.clear()
        _WINDOWS[n] = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(n) + 0.5) / n)
    return _WINDOWS[n]
