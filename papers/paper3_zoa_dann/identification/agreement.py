"""Distance of simulated signals from measured ones: PRD, RMSE and MMD, of waveforms and of spectra.

The paper's formulas are lost with its equations; these are the usual ones. Windows are scaled to unit RMS, since the
paper's load of 12 kN makes the twin vibrate a hundred times too strongly; PRD and RMSE then say the same. A phase that
no model predicts is taken out by shifting each simulated window (circularly) to where it correlates best.
"""

import numpy as np
from scipy.spatial.distance import cdist

from papers.arrays import Array

METRICS = ("prd", "rmse", "mmd")


def windows(samples: Array, length: int) -> Array:
    """Windows one after another, without mean, of unit RMS [windows, length]."""
    count = samples.size // length
    cut = samples[: count * length].reshape(count, length)
    cut = cut - cut.mean(axis=1, keepdims=True)
    return np.asarray(cut / np.sqrt(np.mean(cut**2, axis=1, keepdims=True)))


def aligned(measured: Array, simulated: Array) -> Array:
    """Each simulated window shifted circularly to where it correlates best with its measured one [windows, length]."""
    spectrum = np.fft.rfft(measured, axis=1) * np.conj(np.fft.rfft(simulated, axis=1))
    lag = np.argmax(np.fft.irfft(spectrum, measured.shape[1], axis=1), axis=1)
    at = (np.arange(measured.shape[1]) - lag[:, None]) % measured.shape[1]
    return np.take_along_axis(simulated, at, axis=1)


def amplitude_spectra(x: Array) -> Array:
    """Amplitude spectrum of each window, Hann taper, without the bin at zero [windows, bins]."""
    taper = np.hanning(x.shape[1])
    return np.asarray(np.abs(np.fft.rfft(x * taper, axis=1))[:, 1:] / taper.sum())


def prd(measured: Array, simulated: Array) -> float:
    """Percentage root-mean-square difference: 100 sqrt(sum (x - y)^2 / sum x^2)."""
    return float(100 * np.sqrt(np.sum((measured - simulated) ** 2) / np.sum(measured**2)))


def rmse(measured: Array, simulated: Array) -> float:
    return float(np.sqrt(np.mean((measured - simulated) ** 2)))


def mmd(measured: Array, simulated: Array) -> float:
    """Maximum mean discrepancy of rows [rows, values] with a Gaussian kernel as wide as the median distance between
    measured ones, biased (Gretton et al., A kernel two-sample test, JMLR 13 (2012) 723, eq. 5)."""
    among = cdist(measured, measured)
    width = np.median(among[np.triu_indices(len(among), 1)])

    def kernel(distance: Array) -> float:
        return float(np.mean(np.exp(-0.5 * (distance / width) ** 2)))

    square = kernel(among) + kernel(cdist(simulated, simulated)) - 2 * kernel(cdist(measured, simulated))
    return float(np.sqrt(max(square, 0.0)))


def agreement(measured: Array, simulated: Array, length: int) -> dict[str, float]:
    """PRD (%), RMSE and MMD of the waveforms and of the spectra of two records [samples], in windows of `length` scaled
    to unit RMS; PRD and RMSE of spectra are those of their means."""
    x, y = windows(measured, length), windows(simulated, length)
    moved, own, other = aligned(x, y), amplitude_spectra(x), amplitude_spectra(y)
    mean, other_mean = own.mean(axis=0), other.mean(axis=0)
    return {
        "waveform prd": prd(x, moved), "waveform rmse": rmse(x, moved), "waveform mmd": mmd(x, moved),
        "spectrum prd": prd(mean, other_mean), "spectrum rmse": rmse(mean, other_mean), "spectrum mmd": mmd(own, other),
    }  # fmt: skip
