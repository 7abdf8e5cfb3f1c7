"""Fit of the healthy part of the twin to spectra: resonance, damping and the two noises.

PSDs of healthy records --(without lines)---> `whittle`: resonance, damping, structure noise and white noise jointly
                                          \\-> `equation_8`: peak of the spectrum, then logarithmic decrement

Both accept records of several sampling rates. Sources: eq. 8 of paper 1 (Simulation-based remaining useful life
prediction of rolling element bearings under varying operating conditions); Whittle's likelihood as in Dzhaparidze 1986.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import find_peaks
from scipy.special import digamma
from scipy.stats import chi2

from twingap._compiled import njit
from twingap.errors import TwingapError
from twingap.identification.mode import autocorrelation
from twingap.identification.spectra import Spectra

Array = NDArray[np.float64]

DAMPING_RANGE = (1e-3, 0.5)
_GRID_DAMPING = np.geomspace(0.004, 0.3, 8)
_STEP = 1e-6
"""Step of the logarithms of frequency and damping in finite differences."""


@dataclass(frozen=True)
class Fixed:
    """Fixed parameters of the healthy model; None = free. RMS values in record units."""

    resonance_hz: float | None = None
    damping_ratio: float | None = None
    structure_noise_rms: float | None = None
    white_noise_rms: float | None = None


NOTHING = Fixed()


@dataclass(frozen=True)
class HealthyFit:
    """Fitted healthy part of the twin.

    Parameters
    ----------
    resonance_hz, damping_ratio : float
        Dominant mode.
    structure_noise_rms : float
        RMS of the noise that passes the mode, record units.
    white_noise_rms : float
        RMS of the added white noise, record units.
    deviance : float
        Twice the gain in log likelihood over white noise alone; nan for eq. 8.
    bins : int
        Number of bins in the fit.
    misfit : float
        Deviance of the spectrum from the fit relative to that of scatter: about 1 for a correct model.
    """

    resonance_hz: float
    damping_ratio: float
    structure_noise_rms: float
    white_noise_rms: float
    deviance: float = np.nan
    bins: int = 0
    misfit: float = 1.0

    @property
    def stands_out(self) -> bool:
        """Whether a mode is significant above white noise, with one false alarm in a thousand over the spectrum."""
        # Neighbouring Hann bins share half of their information, so half of the deviance is independent.
        return not self.deviance / 2 < chi2.isf(1e-3 / max(self.bins, 1), 3)

    def psd(self, spectra: Spectra) -> Array:
        """Expected PSD of healthy records by the estimator behind `spectra` [bins]."""
        acf = autocorrelation(self.resonance_hz, self.damping_ratio, spectra.fs_hz, spectra.segment)
        acf *= self.structure_noise_rms**2
        acf[0] += self.white_noise_rms**2
        return spectra.expected(acf)


def whittle(
    measured: Sequence[Spectra],
    *,
    lines: bool = False,
    start: HealthyFit | None = None,
    fixed: Fixed = NOTHING,
    beneath: Sequence[Spectra] = (),
) -> HealthyFit:
    """Fit the mode and the white floor to averaged PSDs by Whittle's likelihood.

    Parameters
    ----------
    measured : sequence of Spectra
        Healthy records, one entry per sampling rate.
    lines : bool
        Whether lines are included, as for faulty records, whose lines have the shape of the mode.
    start : HealthyFit, optional
        Initial values; a grid over the band when absent.
    fixed : Fixed
        Fixed parameters.
    beneath : sequence of Spectra, optional
        Spectra of the same rate and segment for each of `measured`, used as the floor. The mode and both noises are
        then those of the excess over it.

    Returns
    -------
    HealthyFit
    """
    averaged = [s.mean(lines=lines) for s in measured]
    kept = [s.usable & (n > 0) for s, (_, n) in zip(measured, averaged, strict=True)]
    floors = [np.ones(s.f_hz.size) for s in measured]
    if beneath:
        averaged, floors = _above(averaged, beneath)
    if not any(k.any() for k in kept):
        raise TwingapError("no part of the spectrum is free of lines", mend="identify from longer records")
    means, totals = [p for p, _ in averaged], [n[k] for (_, n), k in zip(averaged, kept, strict=True)]
    # The likelihood depends on ratios only, so power is in units of that of the records.
    power = float(np.average([p[k].mean() if k.any() else 0.0 for p, k in zip(means, kept, strict=True)]))
    scaled = [np.maximum(p / power, 1e-12) for p in means]
    top = min(s.fs_hz for s in measured) / 2

    def shape(spectra: Spectra, frequency: Array | float, damping: Array | float) -> Array:
        """Expected PSD of unit structure noise, relative to that of unit white noise."""
        acf = autocorrelation(frequency, damping, spectra.fs_hz, spectra.segment)
        return spectra.expected(acf) * spectra.fs_hz / 2

    def shapes(log_frequency: float, log_damping: float) -> list[Array]:
        """Shapes at the kept bins."""
        mode = float(np.exp(log_frequency)), float(np.exp(log_damping))
        return [shape(s, *mode)[k] for s, k in zip(measured, kept, strict=True)]

    observed = [p[k] for p, k in zip(scaled, kept, strict=True)]
    under = [f[k] for f, k in zip(floors, kept, strict=True)]

    def loss(at: Array) -> tuple[float, Array]:
        """Negative log likelihood and its gradient, by finite differences of the shape for the mode."""
        frequency, damping = float(at[0]), float(at[1])
        structure, floor = np.exp(at[2]), np.exp(at[3])
        out, slope = 0.0, np.zeros(4)
        moved = shapes(frequency + _STEP, damping), shapes(frequency, damping + _STEP)
        own = zip(measured, observed, totals, shapes(frequency, damping), *moved, under, strict=True)
        for s, p, n, mode, higher, wider, white in own:
            model = (structure * mode + floor * white) * 2 / s.fs_hz
            ratio = p / model
            out += float(n @ (np.log(model) + ratio))
            steep = n * (1 - ratio) / model * (2 / s.fs_hz)
            changes = ((higher - mode) / _STEP * structure, (wider - mode) / _STEP * structure, mode * structure)
            slope += [float(steep @ change) for change in (*changes, white * floor)]
        return out, slope

    lowest = min(float(s.f_hz[k][0]) for s, k in zip(measured, kept, strict=True) if k.any())
    bounds = np.log([(lowest, 0.98 * top), DAMPING_RANGE, (1e-10, 1e10), (1e-10, 1e10)])
    known = _as_point(fixed, power)
    bounds = np.where(np.isfinite(known)[:, None], known[:, None], bounds)
    if start is not None:
        begins = [np.where(np.isfinite(known), known, _as_point(start, power))]
    else:
        frequencies = np.exp(np.unique(bounds[0])) if np.ptp(bounds[0]) == 0 else np.linspace(top / 60, 0.97 * top, 60)
        dampings = np.exp(np.unique(bounds[1])) if np.ptp(bounds[1]) == 0 else _GRID_DAMPING
        begins = _grid(measured, scaled, kept, totals, floors, frequencies, dampings, shape)
    runs = [
        minimize(
            loss, np.clip(b, *bounds.T), jac=True, method="L-BFGS-B", bounds=bounds.tolist(), options={"ftol": 1e-13}
        )
        for b in begins
    ]
    best = min(runs, key=lambda run: float(run.fun))
    level = sum(
        float(np.sum(n * p[k] / u)) * s.fs_hz / 2
        for s, p, k, n, u in zip(measured, scaled, kept, totals, under, strict=True)
    )
    level /= sum(float(n.sum()) for n in totals)
    flat = sum(
        float(np.sum(n * (np.log(level * u * 2 / s.fs_hz) + p[k] * s.fs_hz / 2 / level / u)))
        for s, p, k, n, u in zip(measured, scaled, kept, totals, under, strict=True)
    )
    # sum n (log p + 1) is the likelihood of an exact model; log n - digamma(n) is that of scatter.
    exact = sum(float(np.sum(n * (np.log(p[k]) + 1))) for p, k, n in zip(scaled, kept, totals, strict=True))
    scatter = sum(float(np.sum(n * (np.log(n) - digamma(n)))) for n in totals)
    f, zeta, structure, floor = np.exp(best.x)
    return HealthyFit(
        float(f), float(zeta), float(np.sqrt(structure * power)), float(np.sqrt(floor * power)),
        max(0.0, 2 * (flat - float(best.fun))), sum(int(k.sum()) for k in kept),
        (float(best.fun) - exact) / scatter,
    )  # fmt: skip


def _above(
    averaged: Sequence[tuple[Array, Array]], beneath: Sequence[Spectra]
) -> tuple[list[tuple[Array, Array]], list[Array]]:
    """PSDs with their remaining independent averages, and floors of mean 1, for measured floors."""
    out, floors = [], []
    for (psd, n), under in zip(averaged, beneath, strict=True):
        floor, m = under.mean(lines=True)
        # The floor scatters too, so averages are those of the ratio.
        out.append((psd, np.where((n > 0) & (m > 0), n * m / np.maximum(n + m, 1e-300), 0.0)))
        floors.append(np.maximum(floor / max(float(floor.mean()), 1e-300), 1e-12))
    return out, floors


def _as_point(known: HealthyFit | Fixed, power: float) -> Array:
    """Logarithms of the four parameters in units of `power`; nan where unknown."""
    rms = (known.structure_noise_rms, known.white_noise_rms)
    values = [known.resonance_hz, known.damping_ratio, *(None if v is None else v**2 / power for v in rms)]
    return np.log([np.nan if v is None else max(v, 1e-10) for v in values])


def _grid(
    measured: Sequence[Spectra],
    scaled: Sequence[Array],
    kept: Sequence[NDArray[np.bool_]],
    totals: Sequence[Array],
    floors: Sequence[Array],
    frequencies: Array,
    dampings: Array,
    shape: Callable[[Spectra, Array, Array], Array],
) -> list[Array]:
    """Best points of a coarse grid, with amplitudes by multiplicative updates (Fevotte 2009, Itakura-Saito)."""
    f, zeta = (a.ravel() for a in np.meshgrid(frequencies, dampings, indexing="ij"))
    sides = []
    for s, p, k, n, floor in zip(measured, scaled, kept, totals, floors, strict=True):
        if not k.any():
            continue
        # Neighbouring bins are averaged, which suffices to select the right peak.
        step = max(1, int(k.sum()) // 256)
        cut = int(k.sum()) // step * step
        coarse = p[k][:cut].reshape(-1, step).mean(axis=1) * s.fs_hz / 2
        with_mode = shape(s, f, zeta)[:, k][:, :cut].reshape(f.size, -1, step).mean(axis=2)
        white = floor[k][:cut].reshape(-1, step).mean(axis=1)
        sides.append((coarse, np.ascontiguousarray(with_mode), white, float(n.mean()) * step))
    amplitudes = np.full((2, f.size), np.mean([side[0].mean() for side in sides]) / 2)
    for _ in range(25):
        up, down = np.zeros_like(amplitudes), np.zeros_like(amplitudes)
        for side in sides:
            _add_updates(*side, amplitudes, up, down)
        amplitudes *= np.sqrt(up / np.maximum(down, 1e-12))
    value = np.zeros(f.size)
    for coarse, modes, white, worth in sides:
        model = np.maximum(amplitudes[0][:, None] * modes + amplitudes[1][:, None] * white, 1e-12)
        value += worth * np.sum(np.log(model) + coarse / model, axis=1)
    picked: list[int] = []
    for place in np.argsort(value):
        if all(abs(np.log(f[place] / f[other])) > 0.1 for other in picked):
            picked.append(int(place))
        if len(picked) == 3:
            break
    return [np.log([f[i], zeta[i], *np.maximum(amplitudes[:, i], 1e-9)]) for i in picked]


@njit(fastmath={"contract"})
def _add_updates(coarse, modes, white, worth, amplitudes, up, down):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Add the terms of the multiplicative updates of both amplitudes [2, points] over the bins of one spectrum."""
    for g in range(modes.shape[0]):
        up_mode, up_white, down_mode, down_white = 0.0, 0.0, 0.0, 0.0
        for k in range(coarse.size):
            model = amplitudes[0, g] * modes[g, k] + amplitudes[1, g] * white[k]
            inverse = 1 / (1e-12 if model < 1e-12 else model)
            pull = coarse[k] * (inverse * inverse)
            up_mode += pull * modes[g, k]
            up_white += pull * white[k]
            down_mode += inverse * modes[g, k]
            down_white += inverse * white[k]
        up[0, g] += worth * up_mode
        up[1, g] += worth * up_white
        down[0, g] += worth * down_mode
        down[1, g] += worth * down_white


def equation_8(measured: Sequence[Spectra], *, lowest_hz: float = 0.0) -> HealthyFit:
    """Eq. 8 of paper 1: the dominant peak of the spectrum, and damping by the logarithmic decrement.

    The paper uses single impact responses; here the decrement is that of the autocovariance, which for a mode driven by
    noise or rare impacts decays as the response does, with much less noise. Maxima x1, x2 one
    period apart: delta = ln|x1 / x2|, zeta = delta / sqrt(4 pi^2 + delta^2).

    Parameters
    ----------
    measured : sequence of Spectra
        Healthy records; the entry with the most averages is used.
    lowest_hz : float
        Lower limit of the peak, Hz.

    Returns
    -------
    HealthyFit
        The white noise is the floor of the spectrum, the structure noise the power above it.

    Raises
    ------
    TwingapError
        When no peak stands out of the floor, or its autocovariance does not oscillate.
    """
    averaged = [s.mean() for s in measured]
    place = max(range(len(measured)), key=lambda i: float(averaged[i][1].max()))
    s, (psd, averages) = measured[place], averaged[place]
    keep = s.usable & (averages > 0) & (s.f_hz >= lowest_hz)
    if keep.sum() < 8:
        raise TwingapError("no part of the spectrum is free of lines", mend="identify from longer records")
    clean = np.interp(s.f_hz, s.f_hz[keep], psd[keep])
    smooth = np.convolve(clean, np.hanning(9) / np.hanning(9).sum(), mode="same")
    smoother = np.convolve(clean, np.hanning(19) / np.hanning(19).sum(), mode="same")
    peak = int(np.argmax(np.where(s.usable & (s.f_hz >= lowest_hz), smoother, 0)))
    floor = float(np.quantile(smooth[keep], 0.1))
    above = np.maximum(smooth - floor, 0)
    # The dominant peak only, down to the scatter of the floor or to the minimum before the next peak.
    low = high = peak
    while low > 1 and above[low - 1] > 0.02 * above[peak] and above[low - 1] < 3 * above[low : peak + 1].min():
        low -= 1
    while (
        high < above.size - 2
        and above[high + 1] > 0.02 * above[peak]
        and above[high + 1] < 3 * above[peak : high + 1].min()
    ):
        high += 1
    hill = np.where((np.arange(psd.size) >= low) & (np.arange(psd.size) <= high), np.maximum(clean - floor, 0), 0.0)
    if not hill.any():
        raise TwingapError("no peak stands out of the spectrum's floor", mend='use method "whittle"')
    delta = _decrement(s, hill)
    width = s.fs_hz / s.segment
    structure = float(np.sum(np.where(s.usable, np.maximum(clean - floor, 0), 0)) * width)
    return HealthyFit(
        float(s.f_hz[peak]), float(delta / np.hypot(2 * np.pi, delta)), float(np.sqrt(structure)),
        float(np.sqrt(floor * s.fs_hz / 2)),
    )  # fmt: skip


def _decrement(spectra: Spectra, hill: Array) -> float:
    """Logarithmic decrement of the autocovariance of one peak: slope over its positive maxima."""
    fine = 16
    # Zero padding in frequency interpolates the decay, so that maxima do not fall between samples.
    padded = np.zeros(fine * spectra.segment // 2 + 1)
    padded[: hill.size] = hill
    decay = np.fft.irfft(padded)[: fine * spectra.segment // 4]
    taper = np.interp(np.arange(decay.size) / fine, np.arange(spectra.segment), spectra.taper)
    decay = decay / taper
    peaks, _ = find_peaks(decay)
    heights = np.concatenate([decay[:1], decay[peaks]])
    # From the second maximum (the first includes remaining white noise) down to a fifth of the first. Scatter is equal
    # at all lags, so the logarithm of a maximum is weighted by its height.
    usable = heights > 0.2 * heights[0]
    last = int(np.argmin(usable)) if not usable.all() else heights.size
    chosen = np.arange(heights.size)[1 : max(last, 2)]
    if chosen.size == 0 or heights[chosen[0]] <= 0:
        raise TwingapError("the response of the dominant peak does not oscillate", mend='use method "whittle"')
    if chosen.size == 1:
        return float(np.log(heights[0] / heights[1]))
    slope = np.polyfit(chosen, np.log(heights[chosen]), 1, w=heights[chosen])[0]
    return float(max(-slope, 1e-6))
