"""Wavelet images in which a bearing fault looks alike on every machine: carrier frequency by envelope order.

A scalogram as it is shows ringing at the machine's own resonances: what one machine taught is wrong on the next. The
spectrum of each of its rows, over orders, shows what repeats: an outer-race defect at BPFO, an inner-race one at BPFI
between side lines of the shaft, whatever resonance carries them; a network that moves along carriers need not know
which. What repeats at no order (a ball whose spin axis wanders) raises the floor instead, and the level. Rows are
whitened, so that the loudest resonance does not hide the others.

Related: the squared-envelope spectrum (Randall and Antoni 2011, DOI 10.1016/j.ymssp.2010.07.017) and the cyclic
modulation spectrum (Antoni and Hanson 2012, DOI 10.1109/JOE.2012.2195852), here with the wavelets of paper 2's network.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, ndimage

from papers.arrays import Array
from twingap import TwingapError
from twingap.signal._input import as_signals, positive

Images = NDArray[np.float32]
CHANNELS = 3
_WAVELET = 1.0
"""Bandwidth parameter B of the Morlet wavelet, centre 1: relative bandwidth 0.16, so that rows know modulations up to a
third of their carrier."""
_FLOOR_ORDERS = 1.0  # half width of the stretch whose median is the floor


@dataclass(frozen=True)
class ImageOptions:
    turns: int = 8  # of the shaft in a piece; 1 / turns is the distance of its orders
    highest_order: float = 12.0  # last column
    carriers: int = 16  # rows, their frequencies in geometric progression
    lowest: float = 0.06  # lowest, highest: first and last carrier, as a share of the sampling rate
    highest: float = 0.42

    def __post_init__(self) -> None:
        if self.turns < 2 or self.carriers < 4 or not 0 < self.lowest < self.highest < 0.5 or self.highest_order < 1:
            raise TwingapError(f"{self} makes no image", where="image options")

    @property
    def orders(self) -> Array:
        return np.arange(1, round(self.turns * self.highest_order) + 1) / self.turns

    def carriers_hz(self, fs_hz: float) -> Array:
        """Carrier frequencies of the rows, Hz."""
        return np.asarray(fs_hz * np.geomspace(self.lowest, self.highest, self.carriers))

    def piece_samples(self, fs_hz: float, speed_rpm: float) -> int:
        return round(self.turns * 60 * fs_hz / speed_rpm)


@dataclass(frozen=True)
class Modulation:
    """Order spectra of the pieces of one recording, before they become images."""

    # [pieces, carriers, orders] power of the normalised squared envelope over what stationary Gaussian noise would
    # show; 1 is noise (up to 15 % more on a carrier so high that its band reaches beyond half the sampling rate)
    lines: Array
    power: Array  # [pieces, carriers] mean power of each row, unit of the samples squared

    def __len__(self) -> int:
        return len(self.lines)

    def pooled(self) -> Modulation:
        """All pieces as one: averaging powers steadies the floor and leaves lines standing."""
        return Modulation(self.lines.mean(axis=0, keepdims=True), self.power.mean(axis=0, keepdims=True))


def pieces_of(x: Array, length: int) -> Array:
    """A record cut into consecutive pieces of `length` samples; the rest is left out. [pieces, length]"""
    count = x.size // length
    if count == 0:
        raise TwingapError(f"{x.size} samples, a piece needs {length}", where="pieces", mend="use fewer turns")
    return np.asarray(x[: count * length].reshape(count, length))


def modulation(x: Array, fs_hz: float, speed_rpm: float, options: ImageOptions) -> Modulation:
    """Scalogram of each piece x [pieces, samples] and the order spectrum of each of its rows."""
    full = options.piece_samples(fs_hz, speed_rpm)
    if x.shape[-1] > full:
        raise TwingapError(f"pieces of {x.shape[-1]} samples, at most {full} expected", where="modulation")
    carriers = options.carriers_hz(fs_hz)
    envelope = scalogram(x, fs_hz, carriers, bandwidth=_WAVELET) ** 2 / 2
    window = np.hanning(x.shape[-1])
    power = envelope @ (window / window.sum())
    safe = np.where(power > 0, power, 1.0)
    spectrum = fft.rfft((envelope / safe[..., None] - (power > 0)[..., None]) * window, full, axis=-1)
    spectrum = spectrum[..., 1 : options.orders.size + 1]
    # Squared envelope of Gaussian noise: spectrum = the row's power spectrum convolved with itself (unit area), which
    # for this wavelet is a bell of standard deviation sqrt(2) s, s = carrier / (2 pi sqrt(B)).
    width = carriers / (2 * math.pi * math.sqrt(_WAVELET))
    hz = options.orders * speed_rpm / 60
    noise = fs_hz * np.exp(-(hz**2) / (4 * width[:, None] ** 2)) / (2 * math.sqrt(math.pi) * width[:, None])
    lines = (spectrum.real**2 + spectrum.imag**2) / (window**2).sum() / noise
    return Modulation(lines, power)


def images(found: Modulation, healthy_power: Array, options: ImageOptions) -> Images:
    """What the network sees [pieces, 3, carriers, orders], log10 of: lines over Gaussian noise; lines over the median
    of their row around them; level over that of the same machine in good order, the same in all columns."""
    lines = np.maximum(found.lines, 1e-6)
    width = 2 * round(_FLOOR_ORDERS * options.turns) + 1
    floor = ndimage.median_filter(lines, size=(1, 1, width), mode="nearest")
    tiny = np.finfo(np.float64).tiny
    level = np.log10(np.maximum(found.power, tiny) / np.maximum(healthy_power, tiny))
    channels = (
        np.clip(np.log10(lines), -2, 3),
        np.clip(np.log10(lines / floor), -2, 3),
        np.broadcast_to(np.clip(level, -3, 3)[..., None], lines.shape),
    )
    return np.stack(channels, axis=1).astype(np.float32)


def scalogram(x: ArrayLike, fs_hz: float, frequencies_hz: ArrayLike, *, bandwidth: float = 1.5) -> Array:
    """Modulus of the continuous wavelet transform of x [..., samples] with the complex Morlet wavelet (PyWavelets'
    ``cmorB-1``, B the bandwidth) at rows of `frequencies_hz` [..., frequencies, samples].

    Peak amplitude, unit of x, whose mean is not taken out: a tone of amplitude A reads A in its row, away from the
    record's ends; less close to half the rate (2 % at 0.4 of the rate with the default, 38 % at 0.45).
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
    scales = rate / frequencies
    wavelet = pywt.ContinuousWavelet(f"cmor{bandwidth!r}-1.0")
    # The wavelet must have died away where PyWavelets cuts it off (at 8 by default).
    wavelet.lower_bound, wavelet.upper_bound = -(reach := math.sqrt(40 * bandwidth)), reach
    coefficients, _ = pywt.cwt(signals, scales, wavelet, method="fft", axis=-1)
    # PyWavelets divides by sqrt(scale), and takes the signal for constant between samples; a tone of frequency f then
    # reads A sqrt(scale) / 2 sinc(f / fs).
    gain = np.sqrt(scales) / 2 * np.sinc(frequencies / rate)
    values: Array = np.moveaxis(np.abs(coefficients) / gain.reshape(-1, *[1] * signals.ndim), 0, -2)
    return values
