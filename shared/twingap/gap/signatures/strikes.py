"""Following the train of a defect's strikes: at what rate, when each falls, how strong it is, with what noise.

RecordView -> band signal z -> |z|^2 -> comb search -> rate -> phase tracking (harmonics 1..4) -> predicted strikes
   z, predicted strikes -> waveform of one strike -> matched filter -> time and strength of every strike (+ noise)

The comb search finds the rate even where its lines are smeared; tracking follows slow wander of the phase with the
shortest window that sharpens harmonics which it has not been fitted to. All strikes then share one waveform, estimated
from them, and a matched filter tells when and how strong each is. The same filter, half a pass off, tells with what
error: its output there is added to ideal strikes, which are then measured alike.
Source: Randall and Antoni, Rolling element bearing diagnostics: a tutorial, MSSP 25 (2011) 485,
doi:10.1016/j.ymssp.2010.07.017 (envelope, order tracking); the matched filter is textbook.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.gap.view import RecordView, band_medians

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SEARCH: Final = 0.06
"""Largest log ratio of the strike rate to the kinematic one that is searched: wrong speed and slip together."""

HARMONICS: Final = 8
"""Lines of the comb that count in the search."""

EVIDENCE: Final = 16.0
"""Log likelihood ratio of the comb from which on there is something to follow; noise alone reaches it in few per cent
of records."""

PHASES: Final = 96
"""Bins of a pass in the mean cycle."""

_FEWEST: Final = 8
"""Strikes that a record must have to be followed."""


@dataclass(frozen=True)
class BandSignal:
    """Analytic signal of the frame's band, moved down by `low_hz`.

    Attributes
    ----------
    z : Complex [m]
        In the unit of the records.
    fs_hz : float
        Its sampling rate, Hz.
    low_hz : float
        Frequency that has become 0, Hz.
    """

    z: Complex
    fs_hz: float
    low_hz: float


@dataclass(frozen=True)
class Comb:
    """Where the lines of the strikes stand in the spectrum of the squared envelope.

    Attributes
    ----------
    rate_hz : float
        Best strike rate, Hz.
    evidence : float
        Log likelihood ratio of lines against none, over all harmonics.
    lines : Complex [bins]
        rfft of the squared envelope less its mean.
    floor : Array [bins]
        Mean of |lines|^2 between lines.
    df_hz : float
        Distance of the bins, Hz.
    """

    rate_hz: float
    evidence: float
    lines: Complex
    floor: Array
    df_hz: float


@dataclass(frozen=True)
class Track:
    """The smooth course of the strike train.

    Attributes
    ----------
    rate_hz : float
        Mean strike rate, Hz.
    grid_s, phase : Array [grid]
        Passes since the record's start over time: rate_hz grid_s + wander.
    before, after : Array [4]
        |line|^2 of harmonics 1..4 of the squared envelope at constant rate, and along the track, over the mean squared
        envelope squared.
    floor : Array [4]
        What noise has there.
    window_passes : float
        Passes over which the phase was smoothed; infinite for a constant rate.
    """

    rate_hz: float
    grid_s: Array
    phase: Array
    before: Array
    after: Array
    floor: Array
    window_passes: float


@dataclass(frozen=True)
class Strikes:
    """Every strike of a record.

    Attributes
    ----------
    number : Array [N]
        Whole passes since the first strike.
    time_s : Array [N]
        When each falls, s since the record's start (up to a constant).
    strength : Array [N]
        Root energy of each in the band: output of the matched filter of unit energy, in unit sqrt(samples of z).
    noise : float
        Mean square output of the filter between the strikes.
    time_error_s, strength_error : Array [N]
        Error that the noise makes, drawn once for each strike.
    strength_clean : Array [N]
        Strength less the noise; what `strength_error` was drawn about.
    cycle : Array [PHASES]
        Mean squared envelope over a pass, its peak at bin PHASES // 4.
    waveform : Complex [L]
        Of one strike, unit energy.
    phase_locked : float
        Length of the mean of carrier phases at the strikes, 0 to 1: 1 where all strikes are true copies.
    """

    number: Array
    time_s: Array
    strength: Array
    noise: float
    time_error_s: Array
    strength_error: Array
    strength_clean: Array
    cycle: Array
    waveform: Complex
    phase_locked: float


def band_signal(view: RecordView) -> BandSignal:
    """The complex signal whose squared modulus is `view.envelope`."""
    n, (low_hz, high_hz) = view.x.size, view.frame.band_hz
    first = int(np.clip(np.floor(low_hz / view.df_hz), 1, max(n // 2 - 2, 1)))
    last = int(np.clip(np.ceil(high_hz / view.df_hz), first + 1, n // 2))
    own = view.transform[first:last]
    m = scipy.fft.next_fast_len(2 * own.size)
    padded = np.zeros(m, complex)
    edge = max(own.size // 16, 1)
    taper = np.ones(own.size)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    taper[:edge], taper[-edge:] = ramp, ramp[::-1]
    padded[: own.size] = own * taper
    return BandSignal(np.asarray(scipy.fft.ifft(padded)) * (2 * m / n), m * view.df_hz, first * view.df_hz)


def find_comb(band: BandSignal, kinematic_hz: float) -> Comb | None:
    """Search the strike rate around the kinematic one, with all harmonics and for sharp and smeared lines alike.

    The mean excess e of n bins over the floor has the log likelihood ratio n (e - 1 - log e) against noise; each
    harmonic counts with the logarithm of it, so that no single tone outweighs a comb.
    """
    squared = band.z.real**2 + band.z.imag**2
    mean = float(squared.mean())
    if not mean > 0:
        return None
    lines = np.asarray(scipy.fft.rfft(squared / mean - 1.0)) / squared.size
    df = band.fs_hz / squared.size
    top = int(min(kinematic_hz * (HARMONICS + 0.6) * np.exp(SEARCH) / df, lines.size - 1))
    lines = lines[: top + 1]
    power = lines.real**2 + lines.imag**2
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
    grid = (np.arange(size) + 0.5) * (duration_s / size)
    demodulated, floors = [], []
    for k in range(1, 5):
        first, last = int((k * rate - half_hz) / comb.df_hz), int((k * rate + half_hz) / comb.df_hz) + 1
        if first < 1 or last > comb.lines.size:
            break
        own = comb.lines[first:last]
        padded = np.zeros(size, complex)
        count = min(own.size, size)
        # Bins become the frequencies 0, 1, ... of a short transform; half a grid step moves the samples to `grid`.
        taper = np.minimum(1.0, 4 * np.minimum(np.arange(count) + 0.5, count - 0.5 - np.arange(count)) / count)
        padded[:count] = own[:count] * taper * np.exp(1j * np.pi * np.arange(count) / size)
        low = np.asarray(scipy.fft.ifft(padded)) * size
        demodulated.append(low * np.exp(-2j * np.pi * (k * rate - first * comb.df_hz) * grid))
        floors.append(float(np.median(comb.floor[first:last])))
    if not demodulated:
        return None
    lines, k = np.array(demodulated), np.arange(1, len(demodulated) + 1)
    floor = np.array(floors)

    # First the best constant rate: the comb's grid is coarse, the fundamental's peak is fine.
    shift = _fine_shift(lines, k, floor, grid, comb.df_hz)
    constant = 2 * np.pi * shift * grid
    wander, window = constant, np.inf
    kept = _power(lines, k, constant)
    # What is not fitted judges; with the fundamental alone there is nothing to judge by, and no wander is assumed.
    judges = slice(1, None)
    best_score = float((kept[judges] / floor[judges]).sum())
    passes = float(rate * duration_s)
    if k.size > 1:
        starts = [constant]
        for attempt in range(2):
            phase, length = starts[attempt], size / (2.0 if attempt == 0 else 6.0)
            while length * passes / size > 5:
                smooth = _smooth(lines[0] * np.exp(-1j * phase), length)
                phase = phase + np.unwrap(np.angle(smooth))
                score = float((_power(lines, k, phase)[judges] / floor[judges]).sum())
                if score > 1.03 * best_score + 3:
                    best_score, wander, window = score, phase, length * passes / size
                length /= 1.6
            if not np.isfinite(window) and kept[0] > 0.7 * float(np.mean(np.abs(_smooth(lines[0], size / passes * 8)) ** 2)):
                break
            # Where the line is smeared, the rate may run through more than a smoothed phase can follow.
            starts.append(_ridge(lines, k, floor * size, size / passes))
    if np.isfinite(window):
        # Had the comb missed the rate, tracking would have made good for it: a straight line is tried there too.
        trend = np.polyfit(grid, wander, 1)
        straight = np.polyval(trend, grid)
        shift = _fine_shift(lines * np.exp(-1j * k[:, None] * straight), k, floor, grid, comb.df_hz)
        straight = straight + 2 * np.pi * shift * grid
        tried = _power(lines, k, straight)
        if (tried / floor).sum() > (kept / floor).sum():
            constant, kept = straight, tried
            if 1.03 * float((kept[judges] / floor[judges]).sum()) + 3 > best_score:
                wander, window = constant, np.inf
    if np.isfinite(window):
        for _ in range(2):
            turned = lines * np.exp(-1j * k[:, None] * wander)
            mean = turned.mean(axis=1, keepdims=True)
            weight = (k[:, None] ** 2 * np.abs(mean) ** 2).sum()
            # d(phase) by least squares; the sine of the angle keeps noise bounded.
            error = (k[:, None] * (np.conj(mean) * turned).imag).sum(axis=0) / max(float(weight), 1e-300)
            wander = wander + _smooth(error.astype(complex), window * size / passes).real.clip(-1, 1)
    pad = np.full(4, np.nan)
    before, after, noise = pad.copy(), pad.copy(), pad.copy()
    before[: k.size], after[: k.size], noise[: k.size] = kept, _power(lines, k, wander), floor
    course = rate * grid + wander / (2 * np.pi)
    # The mean rate over the record, from the course at both of its ends.
    mean_rate = rate + float(wander[-1] - wander[0]) / (2 * np.pi * (grid[-1] - grid[0]))
    return Track(mean_rate, grid, course, before, after, noise, float(window))


def measure_strikes(band: BandSignal, course: Track, fs_hz: float) -> Strikes | None:
    """Time and strength of every strike along the track, by a matched filter whose waveform the strikes themselves give.

    Returns None for fewer than eight strikes.
    """
    z, fs = band.z, band.fs_hz
    squared = z.real**2 + z.imag**2
    spacing = fs / course.rate_hz
    if spacing < 6:
        return None
    phase = _extended(course, np.arange(z.size) / fs)
    bins = (np.mod(phase, 1.0) * PHASES).astype(int).clip(0, PHASES - 1)
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
        magnitude = np.abs(filtered)
        centre = np.round(places).astype(int)
        seen = magnitude[centre[:, None] + lags]
        seen[:, np.abs(lags) > limit] = 0
        # Strikes scatter about their place as far as they do, no farther: noise is kept out.
        offset = lags[seen.argmax(axis=1)]
        at = centre + offset
        usual = np.median(offset)
        spread = 1.4826 * float(np.median(np.abs(offset - usual)))
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
    # Ideal strikes, each of its own strength at a random place within a sample, in the noise of its own pass.
    own = _autocorrelation(waveform, limit)
    clean = np.sqrt(np.maximum(strength**2 - noise, 0.05 * float((strength**2).mean())))
    ideal = clean[:, None] * own[None, :] + off
    place_off, strength_off = _refined(np.abs(ideal), used)
    error = place_off
    if locked > 0.6:
        tau = tau_fine
        # As for the strikes: the carrier's phase at the envelope's peak, which may pick the wrong one of its periods.
        top = np.abs(ideal).argmax(axis=1)
        angle = np.angle((ideal * turn)[rows, top] * np.exp(2j * np.pi * carrier * (place_off - used[top]) / fs))
        error = place_off - angle / (2 * np.pi * carrier / fs)
    return Strikes(
        numbers - numbers[0],
        tau / fs,
        strength,
        noise,
        error / fs,
        strength_off - clean,
        clean,
        cycle,
        waveform,
        locked,
    )


def _fine_shift(lines: Complex, k: Array, floor: Array, grid: Array, df_hz: float) -> float:
    """Correction of the rate, Hz, that makes all harmonics together strongest within one bin either side."""
    shifts = np.linspace(-1.5, 1.5, 121) * df_hz
    turn = np.exp(-2j * np.pi * shifts[:, None] * grid)
    score, turned = np.zeros(shifts.size), np.ones_like(turn)
    for i in range(k.size):
        turned = turned * turn
        score += np.abs(turned @ lines[i]) ** 2 / floor[i]
    return float(shifts[int(score.argmax())])


def _ridge(lines: Complex, k: Array, noise: Array, per_pass: float) -> Array:
    """[grid] Phase of the course of the rate that gathers most power, by dynamic programming over short spectra.

    Parameters
    ----------
    lines : Complex [harmonics, grid]
    k : Array [harmonics]
    noise : Array [harmonics]
        Mean square of a line's samples that is noise.
    per_pass : float
        Grid places per pass.
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
    for i in range(min(k.size, 3)):
        turn = np.exp(-2j * np.pi * k[i] * place[:, None] * (grid / per_pass)) * window[:, None]
        power += np.abs(lines[i][begin[:, None] + place] @ turn) ** 2 / (noise[i] * float((window**2).sum()))
    step = (grid[:, None] - grid) / 0.01
    penalty = 0.5 * step**2
    best, trace = power[0], np.zeros(power.shape, int)
    for row in range(1, begin.size):
        reached = best - penalty
        trace[row] = reached.argmax(axis=1)
        best = reached.max(axis=1) + power[row]
    at = np.empty(begin.size, int)
    at[-1] = int(best.argmax())
    for row in range(begin.size - 1, 0, -1):
        at[row - 1] = trace[row, at[row]]
    course = np.interp(np.arange(size), begin + length / 2, grid[at])
    return np.asarray(np.cumsum(course) * (2 * np.pi / per_pass))


def _power(lines: Complex, k: Array, phase: Array) -> Array:
    """[harmonics] |mean|^2 of the lines along a phase."""
    return np.asarray(np.abs((lines * np.exp(-1j * k[:, None] * phase)).mean(axis=1)) ** 2)


def _smooth(values: Complex, length: float) -> Complex:
    """Hann-weighted running mean of about `length` samples, over what there is at the ends."""
    half = max(int(round(length)), 1)
    half = min(half, values.size - 1)
    kernel = 0.5 + 0.5 * np.cos(np.pi * np.arange(-half, half + 1) / (half + 1))
    size = scipy.fft.next_fast_len(values.size + 2 * half)
    transform = scipy.fft.fft(kernel, size)
    sums = scipy.fft.ifft(transform * scipy.fft.fft(values, size))[half : half + values.size]
    reach = np.concatenate(([0.0], np.cumsum(kernel)))
    place = np.arange(values.size)
    share = reach[np.minimum(half + 1 + place, 2 * half + 1)] - reach[np.maximum(half + 1 + place - values.size, 0)]
    return np.asarray(sums / share)


def _extended(course: Track, t: Array) -> Array:
    """Phase of the train at any time of the record, passes; beyond the grid's ends at the mean rate."""
    wander = course.phase - course.rate_hz * course.grid_s
    return np.asarray(course.rate_hz * t + np.interp(t, course.grid_s, wander))


def _extent(cycle: Array) -> tuple[float, float]:
    """Passes before and after the peak (bin PHASES // 4) within which a strike stands out of the mean cycle."""
    peak = PHASES // 4
    bottom = float(np.sort(cycle)[: PHASES // 6].mean())
    above = (cycle - bottom) > 0.06 * (cycle[peak] - bottom)
    ahead = above[peak : peak + PHASES // 2]
    # The last bin above, not the first below: a second strike may follow.
    high = (int(np.flatnonzero(ahead).max()) + 1) / PHASES
    behind = above[peak - PHASES // 5 : peak + 1][::-1]
    low = (int(np.argmin(behind)) if not behind.all() else behind.size) / PHASES
    return float(np.clip(low + 0.02, 0.03, 0.2)), float(np.clip(high, 0.04, 0.5))


def _waveform(slices: Complex, start: Complex | None) -> Complex:
    """Unit vector that all slices share up to a complex factor: their first principal component, by power iteration."""
    own = slices[int(np.argsort((np.abs(slices) ** 2).sum(axis=1))[slices.shape[0] * 3 // 4])] if start is None else start
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
    """[2 limit + 1] Answer of the matched filter to its own waveform."""
    full = np.correlate(waveform, waveform, mode="full")
    middle = waveform.size - 1
    out = np.zeros(2 * limit + 1, complex)
    reach = min(limit, middle)
    out[limit - reach : limit + reach + 1] = full[middle - reach : middle + reach + 1]
    return out


def _refined(seen: Array, lags: NDArray[np.int64]) -> tuple[Array, Array]:
    """Place (in samples, by a parabola) and height of the largest value of each row [strikes, lags]."""
    rows = np.arange(seen.shape[0])
    top = seen.argmax(axis=1).clip(1, lags.size - 2)
    left, middle, right = seen[rows, top - 1], seen[rows, top], seen[rows, top + 1]
    bend = 2 * middle - left - right
    part = np.where(bend > 1e-12 * middle, 0.5 * (right - left) / np.where(bend > 0, bend, 1.0), 0.0).clip(-0.5, 0.5)
    return lags[top] + part, np.maximum(middle + 0.25 * (right - left) * part, 0.0)


def _without(off: Complex, peak: Complex) -> Complex:
    """Output between strikes [strikes, lags], less what the strikes before and after [strikes] still ring there."""
    both = np.stack((peak, np.concatenate((peak[1:], peak[-1:]))), axis=1)
    square = both.conj().T @ both + 1e-9 * float((np.abs(peak) ** 2).sum() + 1e-300) * np.eye(2)
    rest = off - both @ np.linalg.solve(square, both.conj().T @ off)
    return np.asarray(rest * np.sqrt(off.shape[0] / max(off.shape[0] - 2, 1)))


def _carrier(band: BandSignal, filtered: Complex, tau: Array, waveform: Complex) -> tuple[float, float, Array]:
    """Carrier frequency (Hz, at the waveform's centroid), phase lock (0 to 1), and times refined by the carrier's phase.

    True copies of one waveform meet the filter with one phase at their true time; how far the phase is off at the time
    of the envelope's peak tells the time to a fraction of a carrier period.
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
