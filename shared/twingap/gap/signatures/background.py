"""Signatures of what lies beneath the lines: shape of the spectrum, roughness, knocks, another bearing, drifts.

smooth spectrum --> relative bands; best single mode + white noise --> what is left: bump, loss, slope
tones taken out --> envelope at 1x (roughness)
whitened -------> knocks: rate, level, ringing
envelopes of four bands, own lines masked --> strongest comb of a foreign order
samples --------> amplitude distribution, changes within the record, and what no catalogued effect moves

`compare` sets mean log spectra of real records against simulated ones and fits the shapes that effects would give.
Sources: Antoni & Randall 2003, doi:10.1115/1.1569940 (roughness as second-order cyclostationarity); Randall & Antoni
2011, doi:10.1016/j.ymssp.2010.07.017; Borghesani & Antoni 2017 (impulsive background).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import NDArray
from scipy.signal import find_peaks

from twingap.gap.signatures.lines import SEARCH, Lines, block_floor, lines_of
from twingap.gap.view import Envelope, RecordView, band_medians, medians

Array = NDArray[np.float64]

BANDS: Final = 32
"""Equal bands of the smooth spectrum between 0 and half the sampling rate."""

_REGIONS: Final = ((0.02, 0.12), (0.12, 0.25), (0.25, 0.48), (0.02, 0.48))
"""Bands over the sampling rate in which another bearing is looked for."""

_QUANTILES: Final = (0.5, 0.9, 0.99, 0.999)
_SEGMENTS: Final = 16

NAMES: Final[tuple[str, ...]] = (
    *(f"band_{i:02d}" for i in range(BANDS)),
    "mode_fs",
    "mode_damping_log",
    "mode_over_white_log",
    "white_level",
    "rest_rms",
    "rest_low",
    "rest_low_slope",
    "rest_high",
    "rest_high_slope",
    "rest_bump",
    "rest_bump_fs",
    "rest_bump_hz_log",
    "rest_bump_width",
    "rest_dip",
    "rest_dip_fs",
    "edge_step",
    "edge_hz_log",
    "rms_log",
    "kurtosis_log",
    "skewness",
    "crest_log",
    "quantile_50",
    "quantile_90_50",
    "quantile_99_90",
    "quantile_999_99",
    "rough_1x",
    "rough_2x",
    "rough_depth",
    "rough_1x_full",
    "rough_ratio_log",
    "envelope_1x",
    "knock_rate_log",
    "knock_count_log",
    "knock_level",
    "knock_peak_log",
    "knock_hz_log",
    "knock_fs",
    "knock_damping_log",
    "white_kurtosis_log",
    "foreign_score",
    *(f"foreign_score_{i}" for i in range(len(_REGIONS))),
    "foreign_order",
    "foreign_excess",
    "foreign_depth",
    "foreign_fs",
    "segment_spread",
    "segment_slope",
    "segment_jump",
    "segment_mean_spread",
    "spectral_drift",
    "time_asymmetry",
    "half_wave_asymmetry",
    "low_skewness",
    "level_coupling",
    "echo_peak",
    "echo_lag_log",
    "modulation_free",
    "modulation_free_hz_log",
    "modulation_slow",
)
"""Keys of `measure`."""

_SETS: Final = ("healthy", "faulty", "all")
_OF_SET: Final = (
    "rms",
    "offset",
    "low",
    "middle",
    "high",
    "slope",
    "bump",
    "bump_fs",
    "bump_width",
    "dip",
    "dip_fs",
    "mode_gain",
    "mode_share",
    "mode_fs",
    "mode_damping_log",
    "loss_share",
    "loss_corner_fs",
    "loss_order",
    "added_share",
    "added_level",
    "added_slope",
    "added_low_fs",
    "added_high_fs",
    "rest_share",
)
COMPARED: Final[tuple[str, ...]] = (
    *(f"{of}_{what}" for of in _SETS for what in _OF_SET),
    "added_level_change",
    "mode_gain_change",
)
"""Keys of `compare`."""


def measure(view: RecordView) -> dict[str, float]:
    """Signatures of the background.

    Parameters
    ----------
    view : RecordView

    Returns
    -------
    dict[str, float]
        `NAMES` -> value, NaN where it does not apply. Levels are log10 of amplitudes over the healthy RMS, excesses
        log10 over what noise shows, frequencies over the sampling rate or log10 of Hz.
    """
    out = dict.fromkeys(NAMES, math.nan)
    if view.x.size < 256 or not np.isfinite(view.mean_square) or view.mean_square <= 0:
        return out
    smooth = view.smooth
    _shape(view, smooth, out)
    _amplitudes(view, out)
    _roughness(view, out)
    _knocks(view, smooth, out)
    _foreign(view, out)
    _drifts(view, out)
    _echo(view, out)
    return {name: value if math.isfinite(value) else math.nan for name, value in out.items()}


# ---------------------------------------------------------------------------------------------- shape of the spectrum


def _shape(view: RecordView, smooth: Array, out: dict[str, float]) -> None:
    """Relative bands, and the smooth spectrum against its best single mode over white noise."""
    smooth = np.maximum(smooth, 1e-300)
    total = float(smooth.sum())
    for i, value in enumerate(smooth.reshape(BANDS, -1).mean(axis=1) * BANDS / total * (smooth.size / BANDS)):
        out[f"band_{i:02d}"] = math.log10(max(value, 1e-12))
    log_s = np.log(smooth).reshape(128, -1).mean(axis=1)
    f = (np.arange(128) + 0.5) / 256
    low, high = (edge / view.fs_hz for edge in view.frame.band_hz)
    inside = np.flatnonzero((f >= low) & (f <= high))
    if inside.size == 0:
        inside = np.array([int(np.argmin(np.abs(f - (low + high) / 2)))])
    top = float(f[inside[int(np.argmax(log_s[inside]))]])
    fit, centre, damping, strength, white = _single_mode(f, log_s, top)
    out["mode_fs"], out["mode_damping_log"] = centre, math.log10(damping)
    out["mode_over_white_log"] = math.log10(max(strength, 1e-12) / max(white, 1e-300) + 1e-6)
    out["white_level"] = 0.5 * math.log10(max(white * view.fs_hz / 2, 1e-300) / max(view.frame.scale, 1e-300) ** 2)
    rest = (log_s - np.log(fit)) / math.log(10)
    out["rest_rms"] = float(np.sqrt(np.mean(rest[1:] ** 2)))
    below, above = (f < 0.6 * centre), (f > min(1.6 * centre, 0.4))
    if np.count_nonzero(below) >= 4:
        out["rest_low"] = float(rest[below].mean())
        out["rest_low_slope"] = _slope(np.log10(f[below]), rest[below])
    if np.count_nonzero(above) >= 4:
        out["rest_high"] = float(rest[above].mean())
        out["rest_high_slope"] = _slope(f[above], rest[above])
    wide = np.convolve(rest, [0.25, 0.5, 0.25], mode="same")
    height, place, width = _bump(wide)
    out["rest_bump"], out["rest_bump_fs"], out["rest_bump_width"] = height, float(f[place]), width / 128
    out["rest_bump_hz_log"] = math.log10(f[place] * view.fs_hz)
    depth, place, _ = _bump(-wide)
    out["rest_dip"], out["rest_dip_fs"] = depth, float(f[place])
    # Ends of a band of noise: the largest step between eight bands on either side, resonance left out.
    fine = np.log10(smooth) - np.interp(np.arange(512), np.arange(128) * 4 + 1.5, np.log10(fit))
    summed = np.concatenate(([0.0], np.cumsum(fine)))
    at = np.arange(8, 504)
    steps = (summed[at + 8] - 2 * summed[at] + summed[at - 8]) / 8
    steps *= np.abs(at / 1024 - centre) > 5 * damping * centre + 8 / 1024
    best = int(np.argmax(np.abs(steps)))
    out["edge_step"], out["edge_hz_log"] = float(steps[best]), math.log10(at[best] / 1024 * view.fs_hz)


_DAMPINGS: Final = np.geomspace(0.01, 0.3, 9)


def _single_mode(f: Array, log_s: Array, top: float) -> tuple[Array, float, float, float, float]:
    """Best a |H|^2 + w of one mode near `top`: the spectrum, its centre, damping, a at resonance, w."""
    centre = np.repeat(np.clip(top * np.array([0.97, 1.0, 1.03]), 1e-3, 0.5), _DAMPINGS.size)
    damping = np.tile(_DAMPINGS, 3)
    shapes = mode_shape(f, centre[:, None], damping[:, None])
    s = np.exp(log_s - log_s.max())
    a, w = _mode_and_white(shapes, s)
    fit = np.maximum(a[:, None] * shapes + w[:, None], 1e-9)
    cost = np.abs(np.log(s) - np.log(fit)).mean(axis=1)
    best = int(np.argmin(cost))
    unit = math.exp(log_s.max())
    strength, white = float(a[best]) * unit, max(float(w[best]), 1e-9) * unit
    return fit[best] * unit, float(centre[best]), float(damping[best]), strength, white


@njit(cache=True, nogil=True, error_model="numpy")
def _mode_and_white(shapes, s):  # type: ignore[no-untyped-def]  # pragma: no cover
    """([shapes], [shapes]) a and w of a shape + w to s [8 k], by weighted least squares: relative errors count."""
    strengths, whites = np.empty(len(shapes)), np.empty(len(shapes))
    sums = np.empty((5, 8))
    for i in range(len(shapes)):
        a, w = 0.0, 0.0
        for step in range(5):
            # Eight partial sums each: differences of these sums all but cancel for some shapes.
            sums[:] = 0.0
            for begin in range(0, s.size, 8):
                for j in range(8):
                    shape, value = shapes[i, begin + j], s[begin + j]
                    fit = max(value if step == 0 else max(a * shape + w, 1e-9), 1e-12)
                    weight = 1 / (fit * fit)
                    sums[0, j] += weight * (shape * shape)
                    sums[1, j] += weight * shape
                    sums[2, j] += weight
                    sums[3, j] += weight * shape * value
                    sums[4, j] += weight * value
            for j in (1, 2, 4):
                for k in range(0, 8, 2 * j):
                    sums[:, k] += sums[:, k + j]
            hh, h1, n1, hs, s1 = sums[:, 0]
            determinant = max(hh * n1 - h1 * h1, 1e-300)
            a, w = max((hs * n1 - s1 * h1) / determinant, 0.0), max((hh * s1 - h1 * hs) / determinant, 0.0)
            a, w = a if w > 0 else hs / hh, w if a > 0 else s1 / n1
        strengths[i], whites[i] = a, w
    return strengths, whites


def mode_shape(f: Array, centre: Array | float, damping: Array | float) -> Array:
    """|H|^2 of a mode's displacement response, 1 at resonance."""
    height = (2 * damping * centre**2) ** 2
    return np.asarray(height / ((centre**2 - f**2) ** 2 + (2 * damping * f * centre) ** 2))


def _bump(curve: Array) -> tuple[float, int, int]:
    """Height, place and width (points above half of it) of a curve's highest place."""
    place = int(np.argmax(curve))
    height = float(curve[place])
    over = curve > height / 2
    left, right = place, place
    while left > 0 and over[left - 1]:
        left -= 1
    while right < curve.size - 1 and over[right + 1]:
        right += 1
    return height, place, right - left + 1


# ----------------------------------------------------------------------------------------- amplitudes, roughness


def _amplitudes(view: RecordView, out: dict[str, float]) -> None:
    """Shape of the amplitude distribution."""
    scale, rms = max(view.frame.scale, 1e-300), math.sqrt(view.mean_square)
    z = view.centred / rms
    square = z * z
    out["rms_log"] = math.log10(rms / scale)
    out["kurtosis_log"] = math.log10(max(float(square @ square) / z.size / 3, 1e-6))
    out["skewness"] = math.tanh(float(square @ z) / z.size)
    size = np.sqrt(square)
    out["crest_log"] = math.log10(float(size.max()))
    places = [min(int(q * z.size), z.size - 1) for q in _QUANTILES]
    rest, values, passed = size, [], 0
    for place in places:  # each in what lies above the last: several places at once take longer
        rest = np.partition(rest, place - passed)[place - passed :]
        values.append(rest[0])
        passed = place
    q = np.log10(np.maximum(values, 1e-6))
    out["quantile_50"] = float(q[0]) + out["rms_log"]
    out["quantile_90_50"], out["quantile_99_90"], out["quantile_999_99"] = (float(v) for v in np.diff(q))
    # Time reversed, a ringing or a saw tooth is another signal; upside down, a one-sided force is.
    step = np.diff(z)
    out["time_asymmetry"] = math.tanh(
        float(np.mean(step * step * step)) / max(float(step @ step) / step.size, 1e-300) ** 1.5
    )
    above = z > 0
    count, power = int(np.count_nonzero(above)), float(square @ above)
    if 0 < count < z.size:
        below = float(square.sum()) - power
        out["half_wave_asymmetry"] = math.log10(max(power / count / max(below / (z.size - count), 1e-300), 1e-6))


_CLEAN: WeakKeyDictionary[RecordView, RecordView] = WeakKeyDictionary()


def _without_tones(view: RecordView) -> RecordView:
    """The record with its tones' bins taken out, but for those of the fault; the record itself where it has none."""
    if not np.any(~lines_of(view).fault_comb[2]):
        return view
    found = _CLEAN.get(view)
    if found is None:
        found = _CLEAN[view] = _cleaned(view)
    return found


def _cleaned(view: RecordView) -> RecordView:
    lines = lines_of(view)
    own = lines.peaks.of(~lines.fault_comb[2])
    clean = RecordView(view.x, view.condition, view.frame)
    spectrum = view.transform.copy()
    places = np.rint(own.hz / view.df_hz).astype(int)
    # A tone without window leaks: what is taken out falls off with its strength.
    reach = np.clip(np.sqrt(own.excess) / 6, 2, 12).astype(int)
    for place, width in zip(places, reach, strict=True):
        low, high = max(place - width, 0), min(place + width + 1, spectrum.size)
        floor = math.sqrt(lines.floor[min(place, lines.floor.size - 1)] * view.x.size**2 / 3)
        part = spectrum[low:high]
        spectrum[low:high] = part * np.minimum(1.0, floor / np.maximum(np.abs(part), 1e-300))
    clean.__dict__["transform"] = spectrum  # in place of the cached property's own
    return clean


def _roughness(view: RecordView, out: dict[str, float]) -> None:
    """Envelope lines at shaft rate that no pair of tones makes."""
    lines, clean = lines_of(view), _without_tones(view)
    reach = 0.002 if lines.locked else SEARCH
    raw = _spectrum(view.envelope, lines.shaft_hz)
    if raw is not None:
        out["envelope_1x"] = float(raw.at(np.array([lines.shaft_hz]), reach)[0][0])
    own = raw if clean is view else _spectrum(clean.envelope, lines.shaft_hz)
    if own is not None:
        logs, power = own.at(lines.shaft_hz * np.array([1.0, 2.0]), reach)
        out["rough_1x"], out["rough_2x"] = float(logs[0]), float(logs[1])
        if np.isfinite(power[0]):
            place = min(round(lines.shaft_hz / own.df_hz), own.floor.size - 1)
            above = max(float(power[0]) - 2 * float(own.floor[place]), 1e-8)
            out["rough_depth"] = 0.5 * math.log10(2 * above)
            if logs[0] > 0.7:
                out["rough_ratio_log"] = _nearest(own, lines.shaft_hz, reach)
    full = _spectrum(clean.envelope_in(0.02 * view.fs_hz, 0.48 * view.fs_hz), lines.shaft_hz)
    if full is not None:
        out["rough_1x_full"] = float(full.at(np.array([lines.shaft_hz]), reach)[0][0])
    if own is not None:
        _free_modulation(view, own, out)


_SPECTRA: WeakKeyDictionary[Envelope, dict[float, Lines]] = WeakKeyDictionary()


def _spectrum(envelope: Envelope, shaft_hz: float) -> Lines | None:
    """The lines of an envelope spectrum, up to thirty shaft orders beyond what fault combs need; found once."""
    if envelope.values.size < 128 or envelope.mean <= 0:
        return None
    known = _SPECTRA.setdefault(envelope, {})
    if shaft_hz not in known:
        last = int(min(80 * shaft_hz / envelope.df_hz, envelope.spectrum.size))
        known[shaft_hz] = Lines(envelope.spectrum[: max(last, 64)], envelope.df_hz, shaft_hz, None)
    return known[shaft_hz]


def _nearest(lines: Lines, hz: float, reach: float) -> float:
    """ln of the strongest peak's frequency near `hz` over it; NaN without one."""
    near = np.flatnonzero(np.abs(lines.peaks.hz / hz - 1) < reach + lines.df_hz / hz)
    if near.size == 0:
        return math.nan
    return math.log(float(lines.peaks.hz[near[int(np.argmax(lines.peaks.excess[near]))]]) / hz)


def _free_modulation(view: RecordView, own: Lines, out: dict[str, float]) -> None:
    """The strongest envelope line that no rotation explains, and how much slow swelling there is."""
    free = own.peaks.of(~_explained(view, own.peaks.hz, own.df_hz))
    best = int(np.argmax(free.excess)) if len(free) else -1
    out["modulation_free"] = math.log10(float(free.excess[best]) / 20) + 0.3 if best >= 0 else 0.0
    if best >= 0:
        out["modulation_free_hz_log"] = math.log10(float(free.hz[best]))
    slow = own.tones[1 : max(min(int(0.3 * own.stated_hz / own.df_hz), 40), 4)]
    out["modulation_slow"] = math.log10(max(float(slow.mean() / own.floor[: slow.size].mean()), 1e-3))


def _explained(view: RecordView, hz: Array, df_hz: float) -> NDArray[np.bool_]:
    """Whether shaft, cage, or the fault with its side lines explain envelope lines."""
    lines = lines_of(view)
    fault = math.nan if view.fault_order is None else _fault_hz(view)
    loose = 0.0 if lines.locked else SEARCH / 2
    return np.asarray(
        _rotation_explains(hz, lines.shaft_hz, view.bearing.ftf * lines.shaft_hz, fault, loose, 2.2 * df_hz)
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _rotation_explains(hz, shaft, cage, fault, loose, width):  # type: ignore[no-untyped-def]  # pragma: no cover
    """[frequencies] Which lie on the shaft's first orders, the cage's, or the fault's with side lines; NaN: no fault."""
    out = np.zeros(hz.size, np.bool_)
    for i in range(hz.size):
        k = max(np.rint(hz[i] / shaft), 1.0)
        out[i] = k <= 3 and abs(hz[i] - k * shaft) < width + loose * min(hz[i], 2 * shaft)
        k = max(np.rint(hz[i] / cage), 1.0)
        out[i] |= k <= 4 and abs(hz[i] - k * cage) < width + 0.03 * hz[i]
        if np.isnan(fault):
            continue
        for k in range(40):
            for side in (0.0, shaft, 2 * shaft, cage):
                off = abs(abs(hz[i] - k * fault) - side)
                out[i] |= off < width + 0.001 * k * fault + 0.03 * side
    return out


_FAULT_HARMONICS: Final = np.arange(1.0, 6.0)
_FAULT_HZ: WeakKeyDictionary[RecordView, float] = WeakKeyDictionary()


def _fault_hz(view: RecordView) -> float:
    """Rate of the fault, off its comb in the raw spectrum or in the envelope; found once."""
    found = _FAULT_HZ.get(view)
    if found is None:
        found = _FAULT_HZ[view] = _search_fault(view)
    return found


def _search_fault(view: RecordView) -> float:
    lines = lines_of(view)
    assert view.fault_order is not None
    stated = view.fault_order * view.shaft_hz
    ratio = lines.fault_comb[0]
    if math.isfinite(ratio):
        return stated * ratio
    env = _spectrum(view.envelope, view.shaft_hz)
    if env is None:
        return stated
    ratios = np.linspace(1 - SEARCH - 0.02, 1 + SEARCH + 0.02, 301)
    places = np.rint(ratios[:, None] * stated * _FAULT_HARMONICS / env.df_hz).astype(int)
    inside = places < env.tones.size - 1
    logs = np.where(inside, np.log10(np.maximum(env.excess[np.minimum(places, env.tones.size - 1)], 1e-2)), 0.0)
    return float(stated * ratios[int(np.argmax(np.clip(logs, 0, 3).sum(axis=1)))])


# ---------------------------------------------------------------------------------------------------------- knocks


def _knocks(view: RecordView, smooth: Array, out: dict[str, float]) -> None:
    """Peaks of the whitened record above noise and above what a fault does once per period."""
    n, fs_hz = view.x.size, view.fs_hz
    root = np.sqrt(np.maximum(smooth, 1e-6 * float(smooth.mean()) + 1e-300))
    gain = 1 / np.interp(np.arange(view.transform.size), (np.arange(512) + 0.5) * (view.transform.size / 512), root)
    # Tones would make peaks too: their bins are brought down to the floor.
    white = _without_tones(view).transform * gain
    w = scipy.fft.irfft(white, n)
    size = np.abs(w)
    sigma = float(medians(size)) / 0.6745
    if sigma <= 0:
        return
    square = w * w
    out["white_kurtosis_log"] = math.log10(max(float(square @ square) * n / float(square.sum()) ** 2 / 3, 1e-6))
    threshold = 5.5 * sigma
    if view.fault_order is not None:
        period = int(np.clip(fs_hz / max(view.fault_order * view.shaft_hz, 1e-6), 8, n // 8))
        peaks = size[: n // period * period].reshape(-1, period).max(axis=1)
        middle = float(medians(peaks))
        threshold = max(threshold, middle + max(6 * float(medians(np.abs(peaks - middle))), 0.5 * middle))
    out["knock_peak_log"] = math.log10(float(size.max()) / threshold)
    apart = max(int(0.004 * fs_hz), 1)
    at = np.empty(0, np.int64)
    if size.max() >= threshold:
        # What lies lower has peaks too, which would only be found to be left out.
        at = find_peaks(np.where(size >= threshold, size, 0.0), height=threshold, distance=apart)[0]
    count = at.size
    out["knock_count_log"] = math.log10(count / view.duration_s + 0.3)
    rate = count / view.duration_s
    if count:
        # Exponential strengths have no memory: what exceeds the threshold is as strong as a knock, in the mean.
        excess = float(size[at].mean()) - threshold
        rate *= math.exp(min(threshold / max(excess, 0.2 * threshold), 3.0)) if count >= 2 else 1.0
        reach = max(int(0.002 * fs_hz), 2)
        around = np.clip(at[:, None] + np.arange(-reach, reach), 0, n - 1)
        x = view.centred
        raw = np.abs(x[around]).max(axis=1)
        share = max(excess / max(float(size[at].mean()), 1e-300), 0.2)
        out["knock_level"] = math.log10(max(float(raw.mean()) * share, 1e-300) / max(view.frame.scale, 1e-300))
        _ringing(view, x, at, out)
    out["knock_rate_log"] = math.log10(rate + 0.3)


def _ringing(view: RecordView, x: Array, at: NDArray[np.int64], out: dict[str, float]) -> None:
    """Frequency and damping of what rings after the strongest knocks, over what the record shows anyway."""
    length = 256
    strongest = at[np.argsort(np.abs(x[at]))[::-1][:8]]
    strongest = strongest[strongest + length <= x.size]
    if strongest.size == 0:
        return
    begin = np.maximum(strongest - 4, 0)
    pieces = x[begin[:, None] + np.arange(length)]
    power = (np.abs(scipy.fft.rfft(pieces, 1024, axis=1)) ** 2).sum(axis=0)
    background = float(medians(power))
    power = np.maximum(power - background, 0.0)
    power[:4] = 0.0
    place = int(np.argmax(power))
    if power[place] <= 0:
        return
    out["knock_fs"] = place / 1024
    out["knock_hz_log"] = math.log10(max(place, 1) / 1024 * view.fs_hz)
    over = power > power[place] / 2
    low = high = place
    while low > 0 and over[low - 1]:
        low -= 1
    while high < over.size - 1 and over[high + 1]:
        high += 1
    out["knock_damping_log"] = math.log10(max(high - low + 1, 1) / 2 / max(place, 1))


# ---------------------------------------------------------------------------------------------------- foreign bearing

_COMB: Final = 4


def _foreign(view: RecordView, out: dict[str, float]) -> None:
    """The strongest comb of envelope lines at an order that is not this bearing's, over four bands."""
    lines = lines_of(view)
    shaft = lines.shaft_hz
    best = (-1.0, 0, 0.0)
    spectra: list[tuple[Lines, Array] | None] = []
    for place, (low, high) in enumerate(_REGIONS):
        env = _spectrum(view.envelope_in(low * view.fs_hz, high * view.fs_hz), shaft)
        if env is None or env.tones.size < 40:
            spectra.append(None)
            continue
        logs = np.log10(np.maximum(env.excess, 1e-2))
        logs[:2] = 0.0
        strong = np.flatnonzero(logs > 0.6)
        own = strong[_explained(view, np.asarray(strong * env.df_hz, float), env.df_hz)]
        logs[own] = 0.0
        spectra.append((env, logs))
        score, hz = _comb(view, env, logs, own)
        out[f"foreign_score_{place}"] = score
        if score > best[0]:
            best = (score, place, hz)
    score, place, hz = best
    found = spectra[place]
    if score < 0 or found is None:
        return
    out["foreign_score"] = score
    env, logs = found
    hz = _refined(env, hz)
    # Where own lines hide some of its envelope's, the third of three may look like the first: the raw comb tells.
    raw_hz = lines.alien_comb[0]
    if math.isfinite(raw_hz):
        multiple = round(hz / raw_hz)
        if multiple in (2, 3) and abs(hz / raw_hz - multiple) < 0.02:
            hz = raw_hz
    first = max(round(hz / env.df_hz), 2)
    out["foreign_excess"] = float(logs[first - 1 : first + 2].max())
    out["foreign_depth"] = 0.5 * math.log10(max(2 * float(env.tones[first - 1 : first + 2].max()), 1e-12))
    if score > 3.2:
        out["foreign_order"] = hz / shaft
        out["foreign_fs"] = sum(_REGIONS[place]) / 2


def _comb(view: RecordView, env: Lines, logs: Array, hidden: NDArray[np.int64]) -> tuple[float, float]:
    """Score and rate of the strongest comb in one envelope spectrum; nothing is known at hidden bins."""
    shaft, df_hz = env.stated_hz, env.df_hz
    wide = logs.copy()
    wide[1:-1] = np.maximum(np.maximum(logs[1:-1], logs[:-2]), logs[2:])
    wide = np.minimum(np.maximum(wide, 0.0), 1.6)
    for k in (-1, 0, 1):
        wide[np.minimum(np.maximum(hidden + k, 0), wide.size - 1)] = np.nan
    top = min(14 * shaft, (wide.size - 3) * df_hz / 2)
    if top <= 1.5 * shaft:
        return 0.0, shaft
    hz = np.arange(1.5 * shaft, top, df_hz / 4)
    bearing = view.bearing
    own_hz = shaft * np.array([bearing.bpfo, bearing.bpfi, 2 * bearing.bsf, bearing.bsf])
    score = _foreign_scores(wide, hz, df_hz, shaft, own_hz, 0.025 if view.fault_order is None else 0.01)
    best = int(np.argmax(score))
    return float(score[best]), float(hz[best])


@njit(cache=True, nogil=True, error_model="numpy")
def _foreign_scores(wide, hz, df_hz, shaft, own_hz, tolerance):  # type: ignore[no-untyped-def]  # pragma: no cover
    """[candidates] Score of the comb with its first line at each frequency; NaN in `wide` is not known."""
    out, reached, places = np.empty(hz.size), 0, hz / df_hz
    for k in range(1, _COMB + 1):
        for place in places:
            at = int(np.rint(k * place))
            if at < wide.size and not np.isnan(wide[at]):
                reached += 1
                break
    for i in range(places.size):
        total, largest, first, seen, sees_first = 0.0, 0.0, 0.0, 0, False
        for k in range(1, _COMB + 1):
            at = int(np.rint(k * places[i]))
            if at >= wide.size or np.isnan(wide[at]):
                continue
            seen += 1
            total += wide[at]
            largest = max(largest, wide[at])
            if k == 1:
                first, sees_first = wide[at], True
        # The strongest line proves no comb: the others do. Where the band is narrow, fewer are asked.
        score = (total - largest) * (_COMB - 1) / max(seen - 1, 1)
        if seen < min(3, reached):
            score *= 0.6
        if first < 0.5:
            score *= 0.5 if sees_first else 0.8
        # A multiple of the true rate has lines of the comb between its own.
        for weight, low, high in ((0.6, 0.5, 1.5), (0.8, 1 / 3, 2 / 3)):
            below, above = int(np.rint(low * places[i])), int(np.rint(high * places[i]))
            if above < wide.size and not (np.isnan(wide[below]) or np.isnan(wide[above])):
                score -= weight * min(wide[below], wide[above])
        for own in own_hz:
            if abs(hz[i] / own - 1) < tolerance + 1.5 * df_hz / own:
                score = 0.0
        turns = hz[i] / shaft
        out[i] = 0.6 * score if abs(turns - np.rint(turns)) * shaft < 1.2 * df_hz else score
    return out


def _refined(env: Lines, hz: float) -> float:
    """A comb's rate by least squares over its interpolated peaks."""
    k = np.rint(env.peaks.hz / hz)
    own = (k >= 1) & (k <= 8) & (np.abs(env.peaks.hz - k * hz) < 1.2 * env.df_hz + 0.2 * env.df_hz * k)
    if not own.any():
        return hz
    return float((k[own] @ env.peaks.hz[own]) / (k[own] @ k[own]))


# -------------------------------------------------------------------------------------- changes within, and the rest


def _drifts(view: RecordView, out: dict[str, float]) -> None:
    """Whether level and spectrum stay within the record, and moments that no catalogued effect has."""
    n = view.x.size // _SEGMENTS
    pieces = view.x[: n * _SEGMENTS].reshape(_SEGMENTS, n)
    level = 0.5 * np.log10(np.maximum(pieces.var(axis=1), 1e-300 + 1e-9 * view.mean_square))
    out["segment_spread"] = math.log10(float(level.std()) + 1e-3)
    out["segment_slope"] = _slope(np.linspace(-0.5, 0.5, _SEGMENTS), level)
    summed = np.concatenate(([0.0], np.cumsum(level)))
    at = np.arange(3, _SEGMENTS - 2)
    jumps = summed[at] / at - (summed[-1] - summed[at]) / (_SEGMENTS - at)
    out["segment_jump"] = float(np.abs(jumps).max())
    means = pieces.mean(axis=1)
    out["segment_mean_spread"] = math.log10(float(means.std()) / math.sqrt(view.mean_square) + 1e-4)
    half = view.x.size // 2
    bands = []
    for piece in (view.x[:half], view.x[half : 2 * half]):
        spectrum = scipy.fft.rfft(piece - piece.mean())
        bands.append(np.log10(np.maximum(band_medians(spectrum.real**2 + spectrum.imag**2, 16), 1e-300)))
    change = bands[1] - bands[0]
    out["spectral_drift"] = math.log10(float(np.std(change)) + 1e-3)
    # Decimated low-pass by its bins alone; a one-sided force or a rub shows there.
    last = max(view.transform.size // 5, 16)
    low = scipy.fft.irfft(view.transform[:last], 2 * (last - 1))
    rms = float(low.std())
    if rms > 0:
        out["low_skewness"] = math.tanh(float((low * low) @ low) / low.size / rms**3)
    # Whether the high band swells with the low band's sign: a quadratic path, a bicoherence in one number.
    rest = view.transform[last : 2 * last]
    z = scipy.fft.ifft(rest, 2 * (last - 1))
    envelope = z.real**2 + z.imag**2
    spread = float(envelope.std()) * rms
    if spread > 0:
        out["level_coupling"] = float(np.mean((envelope - envelope.mean()) * low)) / spread * math.sqrt(last) / 10


def _echo(view: RecordView, out: dict[str, float]) -> None:
    """Highest cepstral place at a lag that neither shaft nor fault explains: an echo of fixed delay."""
    power = view.transform.real**2 + view.transform.imag**2
    log_power = np.log(np.maximum(power, 1e-300 + 1e-12 * float(power.mean())))
    coarse = band_medians(log_power[1:], 48)
    centres = (np.arange(48) + 0.5) * ((power.size - 1) / 48)
    log_power -= np.interp(np.arange(power.size), centres, coarse)
    log_power[0] = 0.0
    # Tones are no ripple.
    cepstrum = scipy.fft.irfft(np.clip(log_power, -4, 2.5), view.x.size)
    last = int(min(0.1 * view.fs_hz, view.x.size // 4))
    if last < 160:
        return
    lags = np.arange(128, last)
    z = cepstrum[lags] * math.sqrt(view.x.size)
    rates = [lines_of(view).shaft_hz]
    if view.fault_order is not None:
        rates.append(_fault_hz(view))
    for rate in rates:
        period = view.fs_hz / rate
        k = np.maximum(np.rint(lags / period), 1)
        z[np.abs(lags - k * period) < 2.5 + 0.01 * lags] = 0.0
    best = int(np.argmax(z))
    free = np.abs(z[z != 0])
    spread = float(medians(free)) / 0.6745 if free.size else 1.0
    out["echo_peak"] = math.log10(max(float(z[best]), 0.0) / max(spread, 1e-9) + 1.0)
    out["echo_lag_log"] = math.log10(lags[best] / view.fs_hz)


def _slope(x: Array, y: Array) -> float:
    """Of the least-squares line."""
    apart = x - x.mean()
    return float(apart @ y) / max(float(apart @ apart), 1e-300)


# ------------------------------------------------------------------------------------------------------------ compare


def compare(real: Sequence[RecordView], simulated: Sequence[RecordView], points: int = 128) -> dict[str, float]:
    """Shape of the difference of mean log smooth spectra, real less simulated.

    Parameters
    ----------
    real, simulated : sequence of RecordView
        Of comparable conditions. Sampling rates may differ between records: places are fractions of them.
    points : int
        Bands that curves are held in.

    Returns
    -------
    dict[str, float]
        `COMPARED` -> value, once for healthy, for faulty and for all records. Per set: rms, mean and the means of
        thirds of the curve in log10 of power; highest and lowest place; and three models, each with its share of the
        curve explained (1 all) and its parameters: one more mode (added in proportion to the simulated level), a
        Butterworth loss before the white noise, and added noise of a power law in a band. Frequencies over fs.
    """
    out = dict.fromkeys(COMPARED, math.nan)
    for of in _SETS:
        curves = [_mean_log(views, of, points) for views in (real, simulated)]
        if curves[0] is not None and curves[1] is not None:
            for what, value in _difference(curves[0], curves[1]).items():
                out[f"{of}_{what}"] = value if math.isfinite(value) else math.nan
    out["added_level_change"] = out["faulty_added_level"] - out["healthy_added_level"]
    out["mode_gain_change"] = out["faulty_mode_gain"] - out["healthy_mode_gain"]
    return out


def _mean_log(views: Sequence[RecordView], of: str, points: int) -> Array | None:
    """[points] Mean over records of ln of density times fs / scale^2."""
    own = [view for view in views if of == "all" or (view.condition.fault == "healthy") == (of == "healthy")]
    if not own:
        return None
    logs = []
    for view in own:
        unit = view.fs_hz / max(view.frame.scale, 1e-300) ** 2
        logs.append(np.log(np.maximum(view.smooth * unit, 1e-30)).reshape(points, -1).mean(axis=1))
    return np.asarray(np.mean(logs, axis=0))


def _difference(real: Array, simulated: Array) -> dict[str, float]:
    """What one pair of mean log spectra shows."""
    f = (np.arange(real.size) + 0.5) / (2 * real.size)
    curve = real - simulated
    ten = curve / math.log(10)
    third = real.size // 3
    out = {
        "rms": float(np.sqrt(np.mean(ten**2))),
        "offset": float(np.median(ten)),
        "low": float(ten[:third].mean()),
        "middle": float(ten[third : 2 * third].mean()),
        "high": float(ten[2 * third :].mean()),
        "slope": _slope(np.log10(f), ten),
    }
    wide = np.convolve(ten, [0.25, 0.5, 0.25], mode="same") - out["offset"]
    height, place, width = _bump(wide)
    out |= {"bump": height, "bump_fs": float(f[place]), "bump_width": width / real.size}
    depth, place, _ = _bump(-wide)
    out |= {"dip": depth, "dip_fs": float(f[place])}
    power = np.exp(simulated)
    total = float((curve**2).mean()) + 1e-4
    shares = []

    def best(modelled: Array) -> tuple[float, int]:
        """Share of the curve explained by the best of candidate curves [candidates, points], and which."""
        left = ((curve - modelled) ** 2).mean(axis=1)
        place = int(np.argmin(left))
        shares.append(1 - float(left[place]) / total)
        return shares[-1], place

    centres, dampings, gains = np.geomspace(0.015, 0.48, 40), np.geomspace(0.01, 0.2, 5), np.geomspace(0.03, 100, 10)
    shapes = mode_shape(f, np.repeat(centres, 5)[:, None], np.tile(dampings, 40)[:, None])
    # Heights over the simulated level at the centre.
    level = np.interp(np.repeat(centres, 5), f, power)[:, None]
    added = (shapes * level / power)[:, None, :] * gains[None, :, None]
    share, at = best(np.log1p(added).reshape(-1, f.size))
    mode, gain = divmod(at, gains.size)
    out |= {"mode_share": share, "mode_gain": math.log10(gains[gain]), "mode_fs": float(centres[mode // 5])}
    out["mode_damping_log"] = math.log10(dampings[mode % 5])

    corners, orders = np.geomspace(0.02, 0.8, 40), np.arange(1, 7)
    loss = 1 / (1 + (f[None, None, :] / corners[:, None, None]) ** (2 * orders[None, :, None]))
    # White noise comes after the sensor; the least density bounds it from above.
    whites = float(np.quantile(power, 0.05)) * np.array([0.0, 0.5, 0.9])[:, None, None, None]
    kept = (loss * np.maximum(power - whites, 0.0) + np.minimum(whites, power)) / power
    share, at = best(np.log(np.maximum(kept, 1e-12)).reshape(-1, f.size))
    corner, order = divmod(at % (corners.size * orders.size), orders.size)
    out |= {"loss_share": share, "loss_corner_fs": float(corners[corner]), "loss_order": float(orders[order])}

    slopes, edges = np.linspace(-1.0, 2.5, 8), np.array([0, 2, 4, 8, 12, 16, 24, 32, 48, 64, 80, 96, 112, 128])
    edges = edges * real.size // 128
    candidates, parameters = [], []
    levels = np.geomspace(0.003, 30, 13)
    for slope in slopes:
        law = f ** (-slope)
        for i, low in enumerate(edges[:-1]):
            for high in edges[i + 1 :]:
                inside = np.zeros_like(f)
                inside[low:high] = law[low:high]
                candidates.append(inside / inside.sum() * (2 * real.size))
                parameters.append((slope, low, high))
    laws = np.array(candidates)
    # The level by its best match at the middle of the band first, then a search about it: few candidates remain.
    with np.errstate(divide="ignore"):
        wanted = np.maximum(np.expm1(np.minimum(curve, 30.0)), 1e-3) * power
    logs = np.where(laws > 0, np.log(np.maximum(wanted, 1e-30))[None, :] - np.log(np.maximum(laws, 1e-30)), np.nan)
    start = np.exp(np.nanmedian(logs, axis=1))
    factors = np.array([0.5, 0.7, 1.0, 1.4])
    modelled = np.log1p(laws[:, None, :] * (start[:, None] * factors)[:, :, None] / power)
    share, at = best(modelled.reshape(-1, f.size))
    law_at, factor = divmod(at, factors.size)
    slope, low, high = parameters[law_at]
    amount = float(np.clip(start[law_at] * factors[factor], levels[0] ** 2, levels[-1] ** 2))
    # Densities are in scale^2 / fs: the mean of `laws` is 2, so that half the amount is a mean square.
    out |= {"added_share": share, "added_level": 0.5 * math.log10(amount), "added_slope": float(slope)}
    out |= {"added_low_fs": low / real.size / 2, "added_high_fs": high / real.size / 2}
    out["rest_share"] = 1 - max(shares)
    return out


__all__ = ["BANDS", "COMPARED", "NAMES", "block_floor", "compare", "measure", "mode_shape"]
