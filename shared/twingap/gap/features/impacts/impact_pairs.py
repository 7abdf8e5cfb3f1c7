"""Entry and exit impacts on a defect: test for two copies of one response in the mean waveform, with delay and ratio.

samples, impact times -> mean waveform of a pass, sub-sample aligned -> all-pole model of its tail -> inverse filter
    -> two-pulse fit over all delays -> gain over one pulse, delay, ratio

A rolling element hits a defect of finite length on entry and on exit (`effects.EntryExit`). Both impacts excite the
same path, so inverse filtering leaves two pulses, even where the ring-down of the first covers the second. The poles
come from the end of the mean waveform, where only ring-down is left. Sawalhi and Randall 2011 whiten with an
autoregressive model in the same spirit.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.gap.features.impacts.impacts import PHASES, Impacts
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, mean_of_five, medians, taper

FINEST_SAMPLES: Final = 2.0
"""Shortest delay that is searched, samples; below it, two impacts cannot be distinguished from one."""
UPSAMPLE: Final = 4
"""Delays per sample: more are finer and slower."""
TOLERANCE: Final = 0.02
"""Part of the spectrum that a model of two poles may miss; without it, frequencies with little noise dominate."""
EDGE: Final = 8
"""Samples at either end of a waveform that alignment by parts of a sample spoils."""
LEAD: Final = 0.34
"""Part of the mean waveform before the impact, so that an earlier impact of the same pass lies in it too."""
FINEST_DEG: Final = 0.4
"""Shortest arc that is searched, degrees; the longest takes nearly half a pass."""


def measure_second_impact(record: RecordTransforms, seen: Impacts, rate_hz: float, out: dict[str, float]) -> None:
    """Fill `second_impact_gain`, `arc_deg`, `arc_log`, `exit_ratio` and `cycle_*`; `rate_hz` is of the impacts."""
    shaft_hz = rate_hz / float(record.fault_order or np.nan)
    deg_per_s = 360 * shaft_hz * _body_rate(record)
    out["cycle_width_deg"] = float(np.log(max(_width(seen.cycle), 0.2 / PHASES) / rate_hz * deg_per_s))
    out["cycle_rise"], part = _rise(seen.cycle)
    if out["cycle_rise"] > 0.03:
        out["cycle_rise_part"] = part
    spacing = record.fs_hz / rate_hz
    waveform, noise, blur = mean_waveform(record.x, seen, record.fs_hz, spacing)
    if waveform is None:
        return
    shortest = max(FINEST_DEG / deg_per_s * record.fs_hz, FINEST_SAMPLES)
    longest = 0.47 * spacing
    if longest < shortest + 1:
        return
    # Tracking may lock on the exit impact: then the entry of the next pass follows, at the rest of the spacing.
    fit = two_pulses(waveform, noise, blur, shortest, 0.7 * spacing)
    if fit is None:
        return
    gain, delay, ratio = fit
    if delay > 0.5 * spacing:
        delay, ratio = spacing - delay, 1 / ratio
    out["second_impact_gain"] = gain
    arc = delay / record.fs_hz * deg_per_s
    if gain > 0.7:
        out["arc_deg"], out["arc_log"], out["exit_ratio"] = arc, float(np.log(arc)), ratio


def mean_waveform(x: Array, seen: Impacts, fs_hz: float, spacing: float) -> tuple[Array | None, Array, Array]:
    """Mean waveform [length] of all impacts, each weighted by its strength and aligned to a fraction of a sample, or
    None.

    It begins `LEAD` of its length before the impact. With it, both [length // 2 + 1], the variance that the noise
    leaves in its spectrum, and the attenuation by errors of alignment, 0 to 1.
    """
    length = int(np.clip(1.04 * spacing, 24, 1024)) // 2 * 2
    long = length + 2 * EDGE
    start = seen.time_s * fs_hz - LEAD * length - EDGE
    first_sample = np.floor(start).astype(int)
    inside = (first_sample >= 0) & (first_sample + long <= x.size)
    if inside.sum() < 8:
        return None, np.zeros(0), np.zeros(0)
    first_sample, part = first_sample[inside], (start - np.floor(start))[inside]
    strength = seen.strength[inside] / max(float(seen.strength.mean()), 1e-300)
    # The ends are cut off after the fractional shift, which oscillates there.
    spectra = scipy.fft.rfft(x[first_sample[:, None] + np.arange(long)] * taper(long, EDGE), axis=1)
    spectra = spectra * np.exp(2j * np.pi * np.arange(long // 2 + 1) / long * part[:, None])
    weight = strength / float((strength**2).sum())
    mean = weight @ spectra
    rest = spectra - strength[:, None] * mean
    noise = (weight**2) @ (rest.real**2 + rest.imag**2)
    quiet = np.interp(np.arange(length // 2 + 1) / length, np.arange(long // 2 + 1) / long, noise) * (length / long)
    error = seen.time_error_s[inside] * fs_hz
    error = error - float(np.average(error, weights=strength**2))
    f = np.arange(length // 2 + 1) / length
    blur = np.abs(np.exp(-2j * np.pi * f[:, None] * error) @ (strength**2)) / float((strength**2).sum())
    return np.asarray(scipy.fft.irfft(mean, long))[EDGE : EDGE + length], np.asarray(quiet), np.asarray(blur)


def two_pulses(
    waveform: Array, noise: Array, blur: Array, shortest: float, longest: float
) -> tuple[float, float, float] | None:
    """Fit one pulse and two pulses through the waveform's own poles; None where there is no fit.

    Waveform [length], `noise` and `blur` are as from `mean_waveform`; delays from `shortest` to `longest`, samples, are
    searched. Returns the log of the misfit of one pulse over that of two, negative where one fits better; the delay in
    samples; and second pulse over first.
    """
    n = waveform.size
    poles = _predictor(waveform, int(LEAD * n))
    if poles is None:
        return None
    spectrum = scipy.fft.rfft(waveform)
    inverse = scipy.fft.rfft(poles, n)
    # Wiener weight: where the waveform does not stand out of the noise, the inverse would show noise.
    power = spectrum.real**2 + spectrum.imag**2
    wide, quiet = mean_of_five(power), mean_of_five(noise)
    weight = np.maximum(1 - 2 * quiet / np.maximum(wide, 1e-300), 0.0)
    shape = 1 / np.maximum(inverse.real**2 + inverse.imag**2, 1e-12)
    # Maximum likelihood: the spectrum is path * pulses + noise of variance `quiet`, which weighs every frequency.
    trust = weight * shape / (quiet + TOLERANCE * wide + 1e-300)
    # Filtered in time, the ring-down of impacts before the window vanishes with the rest.
    driven = np.convolve(waveform, poles)[:n]
    driven[: poles.size - 1] = 0.0
    pulses = scipy.fft.rfft(driven * taper(n, 3))
    m = n * UPSAMPLE
    response = scipy.fft.irfft(pulses * trust * blur, m)
    kernel = scipy.fft.irfft(trust * blur**2 + 0j, m)
    total = float(scipy.fft.irfft((pulses.real**2 + pulses.imag**2) * trust + 0j, m)[0])
    if not kernel[0] > 0 or not total > 0:
        return None
    kernel, response, total = kernel / kernel[0], response / kernel[0], total / kernel[0]
    near = np.arange(0, int(0.75 * m))
    # One impact that falls between two samples is two neighbouring pulses.
    single = _pair(response, kernel, near, np.array([UPSAMPLE]), one_sign=False)[0][:, 0]
    one, place = float(single.max()), int(single.argmax())
    delays = np.arange(int(np.ceil(shortest * UPSAMPLE)), min(int(longest * UPSAMPLE) + 1, m))
    if delays.size < 2:
        return None
    # Every third place first, then all about the best: the kernel is wider than that. One of the two impacts is near
    # the best single one.
    near = np.arange(max(place - int(delays[-1]) - 4 * UPSAMPLE, 0), min(place + 4 * UPSAMPLE, near.size))
    energy = _pair(response, kernel, near[::3], delays[::3])[0]
    i, j = np.unravel_index(int(energy.argmax()), energy.shape)
    near = np.arange(near[3 * i] - 4, near[3 * i] + 5)
    delays = delays[max(3 * int(j) - 4, 0) : 3 * int(j) + 5]
    energy, ratio = _pair(response, kernel, near, delays)
    i, j = np.unravel_index(int(energy.argmax()), energy.shape)
    two = float(energy[i, j])
    rest = 0.01 * total
    gain = float(np.log((max(total - one, 0.0) + rest) / (max(total - two, 0.0) + rest)))
    return gain, _peak(energy[i], int(j), delays) / UPSAMPLE, float(ratio[i, j])


def _pair(
    response: Array, kernel: Array, near: NDArray[np.int64], delays: NDArray[np.int64], *, one_sign: bool = True
) -> tuple[Array, Array]:
    """[near, delays] Energy that two pulses explain, the first at `near`, and second over first."""
    m = response.size
    first = response[near % m][:, None]
    second = response[(near[:, None] + delays) % m]
    cross = kernel[delays]
    determinant = np.maximum(1 - cross**2, 0.02)
    energy = (first**2 + second**2 - 2 * first * second * cross) / determinant
    a, b = first - second * cross, second - first * cross
    # Entry and exit have the same sign and similar size.
    ratio = b / np.where(np.abs(a) > 1e-300, a, 1e-300)
    return (np.where((ratio > 0.25) & (ratio < 4.0), energy, 0.0) if one_sign else energy), ratio


def _peak(energy: Array, j: int, delays: NDArray[np.int64]) -> float:
    """Delay at a maximum of the energy, by a parabola."""
    if not 0 < j < energy.size - 1 or energy[j - 1] <= 0 or energy[j + 1] <= 0:
        return float(delays[j])
    left, middle, right = energy[j - 1 : j + 2]
    return float(delays[j] + np.clip(0.5 * (right - left) / max(2 * middle - left - right, 1e-300), -0.5, 0.5))


def _predictor(waveform: Array, start: int) -> Array | None:
    """[3] Inverse filter of the path, 1 + a1 z^-1 + a2 z^-2: least squares on the ring-down from `start` on.

    Impacts are short and ring-down is long: predictions fail only at impacts, so the largest errors are left out and
    the rest is fitted again.
    """
    design, target = np.stack((waveform[1:-1], waveform[:-2]), axis=1), waveform[2:]
    design, target = design[max(start - 2, 0) :], target[max(start - 2, 0) :]
    keep = np.ones(target.size, bool)
    solution: Array = np.zeros(2)
    for _ in range(3):
        if keep.sum() < 8:
            return None
        solution = np.asarray(np.linalg.lstsq(design[keep], target[keep], rcond=None)[0], float)
        miss = np.abs(target - design @ solution)
        keep = miss < max(4 * float(medians(miss[keep])), 1e-300)
    out = np.concatenate(([1.0], -solution))
    return out if np.isfinite(out).all() else None


def _body_rate(record: RecordTransforms) -> float:
    """Turns of the body with the defect past the roller per turn of the shaft (see `effects.EntryExit`)."""
    cage = record.bearing.ftf
    rates = {"outer": cage, "inner": 1 - cage, "ball": record.bearing.bsf, "cage": 1 - cage}
    return rates[str(record.condition.fault)]


def _width(cycle: Array) -> float:
    """Root mean square width of the impact in the mean cycle, passes."""
    bottom = float(np.sort(cycle)[: PHASES // 4].mean())
    above = np.maximum(cycle - bottom - 0.05 * (cycle.max() - bottom), 0.0)
    total = float(above.sum())
    if not total > 0:
        return 0.0
    place = np.arange(PHASES)
    centre = float((above * place).sum() / total)
    return float(np.sqrt((above * (place - centre) ** 2).sum() / total)) / PHASES


def _rise(cycle: Array) -> tuple[float, float]:
    """Rise of the mean cycle's autocorrelation, and its part of a pass: with one impact it only falls."""
    above = np.maximum(cycle - float(np.sort(cycle)[: PHASES // 4].mean()), 0.0)
    power = np.abs(np.fft.rfft(above)) ** 2
    likeness = np.fft.irfft(power, PHASES)[: PHASES // 2 + 1]
    if not likeness[0] > 0:
        return 0.0, 0.5
    rise = (likeness - np.minimum.accumulate(likeness)) / likeness[0]
    place = int(np.argmax(rise))
    return float(rise[place]), place / PHASES
