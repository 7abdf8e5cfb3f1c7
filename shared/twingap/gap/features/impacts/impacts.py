"""Impacts of a defect: time and strength of each, and the errors of both.

band signal, track of the rate (envelope_comb) -> mean cycle -> predicted impacts -> waveform of one impact
    -> matched filter -> time and strength of every impact; its output between impacts -> their errors

All impacts share one waveform, estimated from them. A matched filter of it gives time and strength of each; the phase
of its output gives the time to a fraction of a carrier period. Its output half a pass off shows the noise, which is
added to ideal impacts that are then measured in the same way: that gives the errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.gap.features.impacts.envelope_comb import BandSignal, Complex, Track
from twingap.records import Array
from twingap.signal.record_transforms import medians

PHASES: Final = 96
"""Bins of a pass in the mean cycle."""
_FEWEST: Final = 8
"""Impacts that a record must have: with fewer, the common waveform is mostly noise."""


@dataclass(frozen=True)
class Impacts:
    """All impacts of a record."""

    number: Array  # [N] number of passes since the first impact
    time_s: Array  # [N] time of each, s since the record's start (up to a constant)
    # [N] Root energy of each in the band: output of the matched filter of unit energy, in unit sqrt(samples of z).
    strength: Array
    noise: float  # mean square output of the filter between the impacts
    time_error_s: Array  # [N] errors due to noise, drawn once for each impact
    strength_error: Array
    strength_clean: Array  # [N] strength less the noise; what `strength_error` was drawn about
    cycle: Array  # [PHASES] mean squared envelope over a pass, its peak at bin PHASES // 4
    # Length of the mean of carrier phases at the impacts, 0 to 1: 1 where all impacts are true copies.
    phase_locked: float


def measure_impacts(band: BandSignal, course: Track) -> Impacts | None:
    """Time and strength of every impact along the track, by a matched filter of their common waveform.

    Returns None for fewer than eight impacts.
    """
    z, fs = band.z, band.fs_hz
    squared = z.real**2 + z.imag**2
    spacing = fs / course.rate_hz
    if spacing < 6:
        return None
    # Passes at each sample; beyond the ends of the track's grid at the mean rate.
    t = np.arange(z.size) / fs
    phase = course.rate_hz * t + np.interp(t, course.grid_s, course.phase - course.rate_hz * course.grid_s)
    bins = np.minimum(((phase - np.floor(phase)) * PHASES).astype(int), PHASES - 1)
    hits = np.maximum(np.bincount(bins, minlength=PHASES), 1)
    cycle = np.bincount(bins, weights=squared, minlength=PHASES) / hits
    # A short smoothing makes the peak certain at low signal to noise.
    blur = np.fft.irfft(np.fft.rfft(cycle) * np.exp(-0.5 * (np.arange(PHASES // 2 + 1) / 24.0) ** 2), PHASES)
    peak = int(blur.argmax())
    cycle = np.roll(cycle, PHASES // 4 - peak)
    low, high = _extent(np.roll(blur, PHASES // 4 - peak))
    before, behind = max(int(low * spacing), 2), max(int(high * spacing), 4)
    numbers = np.arange(np.ceil(phase[0]) - 1, np.floor(phase[-1]) + 2)
    places = np.interp(numbers + (peak + 0.5) / PHASES, phase, np.arange(z.size), left=-1, right=-1)
    reach = max(int(0.22 * spacing), 2)
    margin = max(before, behind) + 2 * reach + 2
    inside = (places > margin) & (places < z.size - margin)
    numbers, places = numbers[inside], places[inside]
    if numbers.size < _FEWEST:
        return None
    offsets, lags = np.arange(-before, behind), np.arange(-reach, reach + 1)
    at = np.round(places).astype(int)
    rows = np.arange(at.size)
    size = scipy.fft.next_fast_len(z.size)
    transform = scipy.fft.fft(z, size)
    waveform, limit = None, reach
    for _ in range(3):
        slices = z[at[:, None] + offsets]
        waveform = _waveform(slices, waveform)
        filtered = _correlate(transform, waveform, before, size)[: z.size]
        magnitude = np.sqrt(filtered.real**2 + filtered.imag**2)  # half of what np.abs takes
        centre = np.round(places).astype(int)
        seen = magnitude[centre[:, None] + lags]
        seen[:, np.abs(lags) > limit] = 0
        # The search is limited to the scatter of the impacts, which keeps noise out.
        offset = lags[seen.argmax(axis=1)]
        at = centre + offset
        usual = medians(offset)
        spread = 1.4826 * float(medians(np.abs(offset - usual)))
        limit = int(np.clip(4 * spread + 0.02 * spacing + 2 + abs(usual), 2, reach))
    assert waveform is not None
    used = lags[np.abs(lags) <= limit]
    place, strength = _refined(magnitude[centre[:, None] + used], used)
    tau = centre + place

    off_centre = np.round(places + 0.5 * spacing * (1 + high - low)).astype(int)
    off_centre = np.minimum(off_centre, z.size - limit - 2)
    off = _without(filtered[off_centre[:, None] + used], filtered[np.round(tau).astype(int)])
    noise = float((np.abs(off) ** 2).mean())
    carrier, locked, tau_fine = _carrier(band, filtered, tau, waveform)
    turn = np.exp(2j * np.pi * band.low_hz * used / fs)
    # Ideal impacts: each with its own strength, at a random place within a sample, in the noise of its own pass.
    own = _autocorrelation(waveform, limit)
    clean = np.sqrt(np.maximum(strength**2 - noise, 0.05 * float((strength**2).mean())))
    ideal = clean[:, None] * own[None, :] + off
    place_off, strength_off = _refined(np.abs(ideal), used)
    error = place_off
    if locked > 0.6:
        tau = tau_fine
        # As for real impacts: the carrier's phase at the envelope's peak, which may pick the wrong period.
        top = np.abs(ideal).argmax(axis=1)
        angle = np.angle((ideal * turn)[rows, top] * np.exp(2j * np.pi * carrier * (place_off - used[top]) / fs))
        error = place_off - angle / (2 * np.pi * carrier / fs)
    return Impacts(
        numbers - numbers[0], tau / fs, strength, noise, error / fs, strength_off - clean, clean, cycle, locked
    )


def _extent(cycle: Array) -> tuple[float, float]:
    """Passes before and after the peak (bin PHASES // 4) within which an impact stands out of the mean cycle."""
    peak = PHASES // 4
    bottom = float(np.sort(cycle)[: PHASES // 6].mean())
    above = (cycle - bottom) > 0.06 * (cycle[peak] - bottom)
    ahead = above[peak : peak + PHASES // 2]
    # The last bin above, not the first below: a second impact may follow.
    high = (int(np.flatnonzero(ahead).max()) + 1) / PHASES
    behind = above[peak - PHASES // 5 : peak + 1][::-1]
    low = (int(np.argmin(behind)) if not behind.all() else behind.size) / PHASES
    return float(np.clip(low + 0.02, 0.03, 0.2)), float(np.clip(high, 0.04, 0.5))


def _waveform(slices: Complex, start: Complex | None) -> Complex:
    """Unit vector that all slices share up to a complex factor: their first principal component, by power iteration."""
    own = (
        slices[int(np.argsort((np.abs(slices) ** 2).sum(axis=1))[slices.shape[0] * 3 // 4])] if start is None else start
    )
    square = slices.T @ slices.conj()
    for _ in range(6):
        own = square @ own
        own = own / max(float(np.linalg.norm(own)), 1e-300)
    return np.asarray(own)


def _correlate(transform: Complex, waveform: Complex, before: int, size: int) -> Complex:
    """Output of the matched filter: sum over l of conj(waveform[l]) z[i - before + l]."""
    kernel = np.zeros(size, complex)
    kernel[: waveform.size] = waveform
    kernel = np.roll(kernel, -before)
    return np.asarray(scipy.fft.ifft(transform * np.conj(scipy.fft.fft(kernel))))


def _autocorrelation(waveform: Complex, limit: int) -> Complex:
    """[2 limit + 1] Response of the matched filter to its own waveform."""
    full = np.correlate(waveform, waveform, mode="full")
    middle = waveform.size - 1
    out = np.zeros(2 * limit + 1, complex)
    reach = min(limit, middle)
    out[limit - reach : limit + reach + 1] = full[middle - reach : middle + reach + 1]
    return out


def _refined(seen: Array, lags: NDArray[np.int64]) -> tuple[Array, Array]:
    """Place (in samples, by a parabola) and height of the largest value of each row [impacts, lags]."""
    rows = np.arange(seen.shape[0])
    top = seen.argmax(axis=1).clip(1, lags.size - 2)
    left, middle, right = seen[rows, top - 1], seen[rows, top], seen[rows, top + 1]
    bend = 2 * middle - left - right
    part = np.where(bend > 1e-12 * middle, 0.5 * (right - left) / np.where(bend > 0, bend, 1.0), 0.0).clip(-0.5, 0.5)
    return lags[top] + part, np.maximum(middle + 0.25 * (right - left) * part, 0.0)


def _without(off: Complex, peak: Complex) -> Complex:
    """Output between impacts [impacts, lags], less the ring-down of the impacts before and after [impacts]."""
    both = np.stack((peak, np.concatenate((peak[1:], peak[-1:]))), axis=1)
    square = both.conj().T @ both + 1e-9 * float((np.abs(peak) ** 2).sum() + 1e-300) * np.eye(2)
    rest = off - both @ np.linalg.solve(square, both.conj().T @ off)
    return np.asarray(rest * np.sqrt(off.shape[0] / max(off.shape[0] - 2, 1)))


def _carrier(band: BandSignal, filtered: Complex, tau: Array, waveform: Complex) -> tuple[float, float, Array]:
    """Carrier (Hz, the waveform's centroid), phase lock (0 to 1), and times refined by the carrier's phase.

    Copies of one waveform give the filter's output the same phase at their true time; the phase error at the time of
    the envelope's peak gives the time to a fraction of a carrier period.
    """
    spectrum = np.abs(scipy.fft.fft(waveform, 4 * waveform.size)) ** 2
    frequency = np.arange(spectrum.size) / spectrum.size * band.fs_hz
    carrier = band.low_hz + float((spectrum * frequency).sum() / max(float(spectrum.sum()), 1e-300))
    nearest = np.round(tau).astype(int).clip(0, filtered.size - 1)
    value = filtered[nearest] * np.exp(2j * np.pi * band.low_hz * nearest / band.fs_hz)
    # The phase at the fractional place.
    value = value * np.exp(2j * np.pi * carrier * (tau - nearest) / band.fs_hz)
    weight = np.abs(value)
    unit = np.where(weight > 0, value / np.where(weight > 0, weight, 1.0), 0.0)
    mean = (unit * weight**2).sum() / max(float((weight**2).sum()), 1e-300)
    locked = float(np.abs(mean))
    late = np.angle(unit * np.conj(mean)) / (2 * np.pi * carrier) * band.fs_hz
    return carrier, locked, tau - late
