"""Comb of envelope lines at the impact rate: search for the rate, and tracking of its slow variation.

RecordTransforms -> band signal z -> |z|^2 -> comb search around the kinematic rate -> phase tracking of harmonics 1..4

The comb search finds the rate even where its lines are smeared. Tracking follows slow phase variation with the window
that most sharpens the harmonics to which it was not fitted. Where the rate varies too much for a smoothed phase, the
course is first found as the ridge of short spectra, by dynamic programming.
Source: Randall and Antoni, Rolling element bearing diagnostics: a tutorial, MSSP 25 (2011) 485,
doi:10.1016/j.ymssp.2010.07.017 (envelope, order tracking).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, band_medians, medians

Complex = NDArray[np.complex128]

SEARCH: Final = 0.06
"""Largest log ratio of the impact rate to the kinematic one that is searched: wrong speed and slip together."""
HARMONICS: Final = 8
"""Lines of the comb that count in the search: more help sharp combs and hurt smeared ones."""
EVIDENCE: Final = 10.0
"""Log likelihood ratio of the comb from which impacts are tracked; white noise reaches 7 in one record of a hundred."""


@dataclass(frozen=True)
class BandSignal:
    """Analytic signal z of the frame's band, its sampling rate, and the frequency that has become 0."""

    z: Complex
    fs_hz: float
    low_hz: float


@dataclass(frozen=True)
class Comb:
    """Lines of the impacts in the spectrum of the squared envelope.

    Best impact rate; log likelihood ratio of lines against none, over all harmonics; `lines` [bins], rfft of the
    squared envelope less its mean; `floor` [bins], mean of |lines|^2 between lines; distance of the bins.
    """

    rate_hz: float
    evidence: float
    lines: Complex
    floor: Array
    df_hz: float


@dataclass(frozen=True)
class Track:
    """Smooth course of the impact rate, whose mean is `rate_hz`."""

    rate_hz: float
    grid_s: Array  # [grid] passes since the record's start over time: rate_hz grid_s + wander
    phase: Array
    # [4] |line|^2 of harmonics 1..4 of the squared envelope at constant rate, and along the track, over the mean
    # squared envelope squared.
    before: Array
    after: Array
    floor: Array  # [4] the same of noise
    window_passes: float  # passes over which the phase was smoothed; infinite for a constant rate


def band_signal(record: RecordTransforms) -> BandSignal:
    """The complex signal whose squared modulus is `record.envelope`."""
    z, first = record.band
    return BandSignal(z * (2 * z.size / record.x.size), z.size * record.df_hz, first * record.df_hz)


def find_comb(band: BandSignal, kinematic_hz: float) -> Comb | None:
    """Search the impact rate around the kinematic one, with all harmonics and for sharp and smeared lines alike.

    The mean excess e of n bins over the floor has the log likelihood ratio n (e - 1 - log e) against noise; each
    harmonic counts with the logarithm of it, so that no single tone outweighs a comb.
    """
    squared = _square(band.z)
    mean = float(squared.mean())
    if not mean > 0:
        return None
    lines = np.asarray(scipy.fft.rfft(squared / mean - 1.0)) / squared.size
    df = band.fs_hz / squared.size
    top = int(min(kinematic_hz * (HARMONICS + 0.6) * np.exp(SEARCH) / df, lines.size - 1))
    lines = lines[: top + 1]
    power = _square(lines)
    count = max(min(power.size // 48, 200), 1)
    per = power.size // count
    if per < 8:
        return None
    coarse = band_medians(power[1:], count) / np.log(2)
    floor = np.interp(np.arange(power.size), (np.arange(count) + 0.5) * per, coarse)
    floor = np.maximum(floor, 1e-12 * power.max() + 1e-300)
    harmonics = int(min(HARMONICS, (power.size - 4) * df / (kinematic_hz * np.exp(SEARCH))))
    if harmonics < 1:
        return None
    step = 0.3 * df / (harmonics * kinematic_hz)
    grid = np.linspace(-SEARCH, SEARCH, 2 * int(np.clip(np.ceil(SEARCH / step), 8, 3000)) + 1)
    total = np.concatenate(([0.0], np.cumsum(power / floor)))
    k = np.arange(1, harmonics + 1)[:, None]
    at = k * (kinematic_hz / df) * np.exp(grid)[None, :]
    best: tuple[float, float, float] | None = None
    for half in (0.0, 0.006, 0.02):
        wide = np.maximum(half * k * kinematic_hz / df, 0.75)
        low = np.clip(np.round(at - wide), 1, power.size - 2).astype(int)
        high = np.clip(np.round(at + wide), low + 1, power.size - 1).astype(int)
        bins = high - low + 1
        excess = np.maximum((total[high + 1] - total[low]) / bins, 1.0)
        ratio = bins * (excess - 1 - np.log(excess))
        score = np.log1p(ratio).sum(axis=0)
        top_score = float(score.max())
        # The middle of the plateau: a window wider than the line has one.
        plateau = np.flatnonzero(score >= top_score - 0.02)
        plateau = plateau[np.abs(plateau - int(score.argmax())) < 0.02 * grid.size]
        place = int(np.round(plateau.mean()))
        if best is None or top_score > best[0] + 0.5:
            best = (top_score, float(grid[place]), float(np.sqrt(ratio[:, place]).sum() ** 2 / harmonics))
    assert best is not None
    return Comb(kinematic_hz * float(np.exp(best[1])), best[2], lines, floor, df)


def track(comb: Comb, duration_s: float) -> Track | None:
    """Follow the phase of the train through harmonics 1..4 of the squared envelope.

    Harmonic 1 is smoothed with windows of falling length; the one is kept that raises harmonics 2..4, taken along, the
    most. Then all harmonics refine the phase together, with weights k^2 |line|^2.
    """
    rate = comb.rate_hz
    half_hz = 0.3 * rate
    size = scipy.fft.next_fast_len(max(int(np.ceil(4 * half_hz * duration_s)), 32))
    grid = np.asarray((np.arange(size) + 0.5) * (duration_s / size), float)
    demodulated, floors = [], []
    for harmonic in range(1, 5):
        centre_hz = harmonic * rate
        first, last = int((centre_hz - half_hz) / comb.df_hz), int((centre_hz + half_hz) / comb.df_hz) + 1
        if first < 1 or last > comb.lines.size:
            break
        own = comb.lines[first:last]
        padded = np.zeros(size, complex)
        count = min(own.size, size)
        # Bins become the frequencies 0, 1, ... of a short transform; half a grid step moves the samples to `grid`.
        taper = np.minimum(1.0, 4 * np.minimum(np.arange(count) + 0.5, count - 0.5 - np.arange(count)) / count)
        padded[:count] = own[:count] * taper * np.exp(1j * np.pi * np.arange(count) / size)
        low = np.asarray(scipy.fft.ifft(padded)) * size
        demodulated.append(low * np.exp(-2j * np.pi * (centre_hz - first * comb.df_hz) * grid))
        floors.append(float(medians(comb.floor[first:last])))
    if not demodulated:
        return None
    lines: Complex = np.array(demodulated)
    k: Array = np.arange(1.0, len(demodulated) + 1)
    floor = np.array(floors)

    # First the best constant rate: the comb's grid is coarse, the fundamental's peak is fine.
    shift = _fine_shift(lines, k, floor, grid, comb.df_hz)
    constant = 2 * np.pi * shift * grid
    wander, window = constant, np.inf
    kept = _power(lines, k, constant)
    # Harmonics that were not fitted decide; with the fundamental alone no wander is assumed.
    unfitted = slice(1, None)
    best_score = float((kept[unfitted] / floor[unfitted]).sum())
    passes = float(rate * duration_s)
    if k.size > 1:
        starts = [constant]
        for attempt in range(2):
            phase, length = starts[attempt], size / (2.0 if attempt == 0 else 6.0)
            while length * passes / size > 5:
                smooth = _smooth(lines[0] * np.exp(-1j * phase), length)
                phase = phase + _unwrapped(smooth)
                score = float((_power(lines, k, phase)[unfitted] / floor[unfitted]).sum())
                if score > 1.03 * best_score + 3:
                    best_score, wander, window = score, phase, length * passes / size
                length /= 1.6
            if not np.isfinite(window) and kept[0] > 0.7 * float(
                np.mean(np.abs(_smooth(lines[0], size / passes * 8)) ** 2)
            ):
                break
            # Where the line is smeared, the rate may vary more than a smoothed phase can follow.
            starts.append(_ridge(lines, k, floor * size, size / passes))
    if np.isfinite(window):
        # Tracking corrects a wrong rate of the comb search: a constant rate is tried there too.
        trend = np.polyfit(grid, wander, 1)
        straight = np.polyval(trend, grid)
        shift = _fine_shift(lines * np.exp(-1j * k[:, None] * straight), k, floor, grid, comb.df_hz)
        straight = straight + 2 * np.pi * shift * grid
        tried = _power(lines, k, straight)
        if (tried / floor).sum() > (kept / floor).sum():
            constant, kept = straight, tried
            if 1.03 * float((kept[unfitted] / floor[unfitted]).sum()) + 3 > best_score:
                wander, window = constant, np.inf
    if np.isfinite(window):
        for _ in range(2):
            turned = lines * np.exp(-1j * k[:, None] * wander)
            mean = turned.mean(axis=1, keepdims=True)
            weight = (k[:, None] ** 2 * np.abs(mean) ** 2).sum()
            # d(phase) by least squares; the sine of the angle keeps noise bounded.
            error = (k[:, None] * (np.conj(mean) * turned).imag).sum(axis=0) / max(float(weight), 1e-300)
            wander = wander + _smooth(error.astype(complex), window * size / passes).real.clip(-1, 1)
    before, after, noise = np.full((3, 4), np.nan)
    before[: k.size], after[: k.size], noise[: k.size] = kept, _power(lines, k, wander), floor
    course = rate * grid + wander / (2 * np.pi)
    # The mean rate over the record, from the course at both of its ends.
    mean_rate = rate + float(wander[-1] - wander[0]) / (2 * np.pi * (grid[-1] - grid[0]))
    return Track(mean_rate, grid, course, before, after, noise, float(window))


def _fine_shift(lines: Complex, k: Array, floor: Array, grid: Array, df_hz: float) -> float:
    """Correction of the rate, Hz, that makes all harmonics together strongest within one bin either side."""
    centre = 0.0
    # Coarse, then fine: a bin of harmonic 1 is four of harmonic 4.
    for reach, count in ((1.5, 31), (0.1, 9), (0.0125, 5)):
        shifts = centre + np.linspace(-reach, reach, count) * df_hz
        turn = _turns(-2 * np.pi * shifts, grid)
        score, turned = np.zeros(shifts.size), np.ones_like(turn)
        for i in range(k.size):
            turned *= turn
            score += _square(turned @ lines[i]) / floor[i]
        centre = float(shifts[int(score.argmax())])
    return centre


def _turns(rates: Array, grid: Array) -> Complex:
    """[rates, grid] exp(i rate t) on an even grid: few exponentials, the rest are products of two."""
    step = float(grid[1] - grid[0]) if grid.size > 1 else 0.0
    fine = np.exp(1j * rates[:, None] * (step * np.arange(16)))
    coarse = np.exp(1j * rates[:, None] * grid[::16])
    return np.asarray((coarse[:, :, None] * fine[:, None, :]).reshape(rates.size, -1)[:, : grid.size])


def _square(values: Complex) -> Array:
    """|values|^2."""
    return np.asarray(values.real**2 + values.imag**2)


def _unwrapped(values: Complex) -> Array:
    """[n] Angles without leaps of a turn."""
    angle = np.angle(values)
    angle[1:] -= np.cumsum(np.rint(np.diff(angle) / (2 * np.pi))) * (2 * np.pi)
    return np.asarray(angle)


def _ridge(lines: Complex, k: Array, noise: Array, per_pass: float) -> Array:
    """[grid] Phase of the course of the rate that gathers most power, by dynamic programming over short spectra.

    From `lines` [harmonics, grid], numbers `k` and `noise` (mean square of a line's samples) of harmonics.
    """
    size = lines.shape[1]
    length, hop = max(int(12 * per_pass), 4), max(int(3 * per_pass), 1)
    if size < length + 2 * hop:
        return np.zeros(size)
    grid = np.linspace(-0.12, 0.12, 61)
    begin = np.arange(0, size - length + 1, hop)
    place = np.arange(length)
    window = np.hanning(length + 2)[1:-1]
    power = np.zeros((begin.size, grid.size))
    turn = _turns(-2 * np.pi / per_pass * grid, np.asarray(place, float)).T
    turned, total = window[:, None] * turn, float((window**2).sum())
    for i in range(min(k.size, 3)):
        if i:
            turned = turned * turn
        power += _square(lines[i][begin[:, None] + place] @ turned) / (noise[i] * total)
    step = (grid[:, None] - grid) / 0.01
    at = _best_path(power, 0.5 * step**2)
    course = np.interp(np.arange(size), begin + length / 2, grid[at])
    return np.asarray(np.cumsum(course) * (2 * np.pi / per_pass))


def _best_path(power: Array, penalty: Array) -> NDArray[np.int64]:
    """[rows] Place in each row of the path of most power less the penalties [places, places] of its steps."""
    best, trace = power[0], np.zeros(power.shape, np.int64)
    for row in range(1, len(power)):
        reached = best[:, None] - penalty
        trace[row] = np.argmax(reached, axis=0)
        best = reached[trace[row], np.arange(len(best))] + power[row]
    at = np.empty(len(power), np.int64)
    at[-1] = np.argmax(best)
    for row in range(len(power) - 1, 0, -1):
        at[row - 1] = trace[row, at[row]]
    return at


def _power(lines: Complex, k: Array, phase: Array) -> Array:
    """[harmonics] |mean|^2 of the lines along a phase."""
    turned = turn = np.exp(-1j * phase)
    sums = np.empty(k.size, np.complex128)
    for i in range(k.size):  # k is 1, 2, ...
        turned = turned * turn if i else turn
        sums[i] = lines[i] @ turned
    return _square(sums) / phase.size**2


def _smooth(values: Complex, length: float) -> Complex:
    """Hann-weighted running mean of about `length` samples, over what there is at the ends."""
    half = min(max(round(length), 1), values.size - 1)
    transform, share = _window(half, values.size)
    sums = scipy.fft.ifft(transform * scipy.fft.fft(values, transform.size))[half : half + values.size]
    return np.asarray(sums / share)


@lru_cache(maxsize=512)
def _window(half: int, count: int) -> tuple[Complex, Array]:
    """Transform of a Hann window of 2 half + 1, and [count] how much of it lies within the values at each place."""
    kernel = 0.5 + 0.5 * np.cos(np.pi * np.arange(-half, half + 1) / (half + 1))
    size = scipy.fft.next_fast_len(count + 2 * half)
    reach = np.concatenate(([0.0], np.cumsum(kernel)))
    place = np.arange(count)
    share = reach[np.minimum(half + 1 + place, 2 * half + 1)] - reach[np.maximum(half + 1 + place - count, 0)]
    return np.asarray(scipy.fft.fft(kernel, size)), np.asarray(share)
