"""Spectral kurtosis and the kurtogram: impulsiveness of a signal by frequency band.

Sources: Antoni, The spectral kurtosis: a useful tool for characterising non-stationary signals, MSSP 20 (2006) 282,
doi:10.1016/j.ymssp.2004.09.001; Antoni, Fast computation of the kurtogram for the detection of transient faults,
MSSP 21 (2007) 108, doi:10.1016/j.ymssp.2005.12.002. Scatter of the estimate: Nita and Gary, MNRAS Lett. 406 (2010) L60,
doi:10.1111/j.1745-3933.2010.00882.x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy import signal as sps

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals, positive, whole, without_mean
from twingap.signal.spectrum import Spectrum, segments_of

_TAPS = 16
_CUTOFF = 0.4
"""Order and cut-off (relative to half the rate) of the prototype low-pass, as in Antoni's code: short, wide overlap."""
_FEWEST = 128
"""Fewest samples in the narrowest band of a kurtogram, before the filters' transients are removed; more limits the
depth."""


def spectral_kurtosis(x: ArrayLike, fs_hz: float, *, window_samples: int, overlap: float = 0.75) -> Spectrum:
    """Spectral kurtosis from short-time spectra, unbiased for stationary Gaussian noise.

    SK(f) = M / (M - 1) ((M + 1) / M <|X|^4> / <|X|^2>^2 - 2) over M frames. 0 for Gaussian noise, -1 for a steady tone,
    large where bursts are shorter than the record. Without overlap of frames, its standard deviation in Gaussian noise
    is `gaussian_sk_sd(M)`. Overlap reduces it, for the same record of 50 frames in simulation, to 0.71 of that at
    overlap 1/2 and 0.59 at 3/4, where the mean is -0.01; `gaussian_sk_sd` of the larger M does not apply then.

    Parameters
    ----------
    x : array_like [..., samples]
    fs_hz : float
        Sampling rate, Hz.
    window_samples : int
        Length of a (Hann) frame: shorter than the interval between impacts, longer than one impact.
    overlap : float
        Fraction shared by neighbouring frames, 0 <= overlap < 1.

    Returns
    -------
    Spectrum
        Hz, dimensionless; 0 at frequencies without energy. At 0 Hz and half the rate spectra are real, so 3 replaces 2;
        the bins next to these are biased by +0.03.

    Raises
    ------
    TwingapError
        For NaN, infinities, or records of fewer than two frames.
    """
    where = "spectral_kurtosis"
    signals = without_mean(as_signals(x, where=where, at_least=3))
    rate = positive(fs_hz, "fs_hz", where=where)
    length, shared = segments_of(signals.shape[-1], window_samples, overlap, where=where)
    hop = length - shared
    frames = (signals.shape[-1] - length) // hop + 1
    if frames < 2:
        raise TwingapError(
            f"{signals.shape[-1]} samples make one frame of {length}, at least two expected",
            where=where,
            mend="use a shorter window",
        )
    weights = sps.get_window("hann", length)
    rows = signals.reshape(-1, signals.shape[-1])
    values = np.empty((rows.shape[0], length // 2 + 1))
    real = np.zeros(length // 2 + 1, dtype=bool)
    real[0] = True
    real[-1] |= length % 2 == 0
    for row, out in zip(rows, values, strict=True):  # one at a time, as overlapping frames need much memory
        spectra = fft.rfft(np.lib.stride_tricks.sliding_window_view(row, length)[::hop] * weights, axis=-1)
        power = spectra.real**2 + spectra.imag**2
        ratio = _ratio(power.mean(axis=0), (power**2).mean(axis=0))
        unbiased = np.where(real, (frames + 2) / frames * ratio - 3, (frames + 1) / frames * ratio - 2)
        out[:] = np.where(ratio > 0, frames / (frames - 1) * unbiased, 0.0)
    return Spectrum(fft.rfftfreq(length, 1 / rate), values.reshape(*signals.shape[:-1], -1))


def gaussian_sk_sd(n_frames: int) -> float:
    """Standard deviation of `spectral_kurtosis` in stationary Gaussian noise, for frames that do not overlap.

    Parameters
    ----------
    n_frames : int
        M, at least 2.

    Returns
    -------
    float
        sqrt(4 M^2 / ((M - 1) (M + 2) (M + 3))), about 2 / sqrt(M). The distribution is skewed to the right: its upper
        tail is heavier than a normal one's.
    """
    m = whole(n_frames, "n_frames", where="gaussian_sk_sd", at_least=2)
    return math.sqrt(4 * m**2 / ((m - 1) * (m + 2) * (m + 3)))


@dataclass(frozen=True)
class Band:
    """A frequency band and its kurtosis.

    Parameters
    ----------
    low_hz, high_hz : float
    level : float
        Level in the kurtogram: log2 of the number of bands of this width.
    kurtosis : float
        Excess kurtosis of the complex envelope; 0 for Gaussian noise.
    """

    low_hz: float
    high_hz: float
    level: float
    kurtosis: float

    @property
    def centre_hz(self) -> float:
        """Centre of the band, Hz."""
        return (self.low_hz + self.high_hz) / 2


@dataclass(frozen=True)
class Kurtogram:
    """Kurtosis of each band in a tree of bands.

    Parameters
    ----------
    level, low_hz, high_hz : Array [bands]
        log2 of the number of bands of that width; edges of the band, Hz. Sorted by level, then frequency.
    n_samples : int array [bands]
        Samples of the envelope from which the kurtosis was estimated.
    kurtosis : Array [..., bands]
        Excess kurtosis of the complex envelope.
    """

    level: Array
    low_hz: Array
    high_hz: Array
    n_samples: NDArray[np.int64]
    kurtosis: Array

    @property
    def best(self) -> list[Band]:
        """The band of highest kurtosis of each signal, leading axes flattened; on a tie the widest."""
        rows = self.kurtosis.reshape(-1, self.level.size)
        return [
            Band(float(self.low_hz[i]), float(self.high_hz[i]), float(self.level[i]), float(row[i]))
            for row, i in zip(rows, rows.argmax(axis=-1), strict=True)
        ]

    def image(self) -> tuple[Array, Array, Array]:
        """Data of an image: levels `[rows]`, column edges, Hz `[columns + 1]`, values `[..., rows, columns]`."""
        levels = np.unique(self.level)
        columns = 3 * round(2 ** levels[-1])
        nyquist = float(self.high_hz.max())
        centres = (np.arange(columns) + 0.5) * nyquist / columns
        place = np.empty((levels.size, columns), dtype=np.intp)
        for row, level in enumerate(levels):
            bands = np.flatnonzero(self.level == level)
            place[row] = bands[np.searchsorted(self.high_hz[bands], centres)]
        return levels, np.linspace(0, nyquist, columns + 1), self.kurtosis[..., place]


def fast_kurtogram(x: ArrayLike, fs_hz: float, *, max_level: int | None = None) -> Kurtogram:
    """Kurtogram by a tree of filters that split bands into halves and thirds (levels 0, 1, 1.58, 2, 2.58, 3, ...).

    Each node filters its parent's complex envelope with a short filter and keeps every second (third) sample; samples
    within the filters' transients are left out. The filters are Antoni's. Unlike in his code, the tree starts from the
    analytic signal: his leaks negative frequencies into the bands at 0 Hz and half the rate, with a kurtosis of 0.18
    there in Gaussian noise, and at level 0 it uses the kurtosis of a real signal, 1.5 times that of envelopes.

    Parameters
    ----------
    x : array_like [..., samples]
        At least 256 samples; the mean is subtracted first.
    fs_hz : float
        Sampling rate, Hz.
    max_level : int, optional
        The narrowest bands are fs / 2^(max_level + 1) wide. At most, and by default, log2(samples) - 7, at which these
        still hold about 128 samples (at most 8 by default: narrower bands are of little use in bearings).

    Returns
    -------
    Kurtogram

    Raises
    ------
    TwingapError
        For NaN, infinities, records too short for the level.
    """
    where = "fast_kurtogram"
    signals = without_mean(as_signals(x, where=where, at_least=2 * _FEWEST))
    rate = positive(fs_hz, "fs_hz", where=where)
    deepest = (signals.shape[-1] // _FEWEST).bit_length() - 1
    levels = min(deepest, 8) if max_level is None else whole(max_level, "max_level", where=where)
    if levels > deepest:
        raise TwingapError(
            f"max_level = {levels}, at most {deepest} for {signals.shape[-1]} samples",
            where=where,
            mend="use longer records or fewer levels",
        )
    found: list[tuple[float, float, float, int, Array]] = []
    root = sps.hilbert(signals, axis=-1)
    found.append((0.0, 0.0, rate / 2, signals.shape[-1], _excess(root)))
    _grow(root, 0, 0, levels, rate, found)
    found.sort(key=lambda band: (band[0], band[1]))
    level, low, high, count, kurtosis = zip(*found, strict=True)
    return Kurtogram(np.array(level), np.array(low), np.array(high), np.array(count), np.stack(kurtosis, axis=-1))


def _grow(
    node: NDArray[Any],
    level: int,
    place: int,
    levels: int,
    rate: float,
    found: list[tuple[float, float, float, int, Array]],
) -> None:
    """Split band `place` of `level`, append the kurtosis of its parts to `found`, and recurse into its halves."""
    for parts in (2, 3) if level + 1 < levels else (2,):
        width = rate / 2 ** (level + 1) / parts
        for part in range(parts):
            child = _part(node, part, parts)
            number = place * parts + part
            edges = number * width, (number + 1) * width
            found.append((level + math.log2(parts), *edges, child.shape[-1], _excess(child)))
            if parts == 2 and level + 1 < levels:
                _grow(child, level + 1, number, levels, rate, found)


def _part(node: NDArray[Any], part: int, parts: int) -> NDArray[np.complex128]:
    """One half (third) of the positive frequencies of `node`, at half (a third) of its rate, shifted down to 0."""
    taps = band_filter(part, parts)
    full = sps.upfirdn(taps, node, down=parts, axis=-1)
    run_in = -(-(taps.size - 1) // parts)
    child: NDArray[np.complex128] = full[..., run_in : (node.shape[-1] - 1) // parts + 1]
    if part % 2:
        # Decimation aliases an odd part to negative frequencies; a shift by half the rate corrects it.
        child = child * (1 - 2 * (np.arange(child.shape[-1]) % 2))
    return child


@lru_cache
def band_filter(part: int, parts: int) -> NDArray[np.complex128]:
    """Quasi-analytic filter for one half or third of the positive frequencies.

    Parameters
    ----------
    part, parts : int
        Index of the part, and number of parts (2 or 3).

    Returns
    -------
    complex array [taps]
        Low-pass of order 16 (24) and cut-off 0.4 (0.27) of half the rate, moved to the middle of the part. Read-only.
    """
    order = _TAPS if parts == 2 else 3 * _TAPS // 2
    low_pass = sps.firwin(order + 1, _CUTOFF if parts == 2 else 2 / 3 * _CUTOFF)
    centre = (part + 0.5) / (2 * parts)
    taps = np.asarray(low_pass * np.exp(2j * np.pi * centre * np.arange(order + 1)))
    taps.flags.writeable = False
    return taps


def _excess(envelope: NDArray[np.complex128]) -> Array:
    """Excess kurtosis of complex envelopes; 0 without energy."""
    energy = envelope.real**2 + envelope.imag**2
    ratio = _ratio(energy.mean(axis=-1), (energy**2).mean(axis=-1))
    return np.where(ratio > 0, ratio - 2, 0.0)


def _ratio(second: Array, fourth: Array) -> Array:
    """Fourth moment over squared second; 0 where there is no energy."""
    squared = second**2
    return np.divide(fourth, squared, out=np.zeros_like(squared), where=squared > 0)
