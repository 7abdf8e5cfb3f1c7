"""Features of the impacts of a defect: rate, timing, strength, modulation, shape and level.

RecordTransforms --(envelope_comb, impacts)--> lines, track, impacts
    lines, track ----------> rate, harmonics, smear, wander        (speed, slip)
    times of impacts ------> timing differences                    (jitter, walk)
    strengths of impacts --> scatter, lines at shaft and cage rate (scatter, load zone, cage)
    mean waveform ---------> second impact of a pass, by impact_pairs (entry and exit); level

The matched filter's output between impacts gives the noise, which is taken out of variances: a faint record and a loud
one measure alike. Sources: Randall and Antoni 2011, doi:10.1016/j.ymssp.2010.07.017; Antoni 2007 (jitter: harmonic n
falls as exp(-(2 pi n sigma)^2 / 2), a walk's lines broaden as n^2).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import nnls

from twingap.gap.features.impacts import envelope_comb, impact_pairs, impacts
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, medians

NAMES: Final[tuple[str, ...]] = (
    "evidence", "rate_log_ratio", "shaft_log_ratio", "harmonic_1", "harmonic_2", "harmonic_3", "harmonic_4",
    "harmonic_slope", "smear_1", "smear_2", "smear_3", "wander_level", "wander_log", "wander_bandwidth_hz",
    "timing_excess", "timing_log_1", "timing_log_4", "timing_growth", "jitter_sigma", "jitter_log", "walk_sigma",
    "walk_log", "scatter_sigma", "scatter_log", "scatter_excess", "strength_skew", "strength_kurtosis",
    "strength_neighbours", "shaft_depth", "shaft_line_log", "cage_depth", "cage_line_log", "zone_depth",
    "second_impact_gain", "arc_deg", "arc_log", "exit_ratio", "cycle_width_deg", "cycle_rise", "cycle_rise_part",
    "phase_lock", "level", "snr",
)  # fmt: skip
"""Keys of `measure`. Natural logs where the name ends in log, level, snr, gain or evidence."""
_TIMING_FLOOR: Final = 1e-3
"""Floor of timing spreads in their logarithms, passes. A smaller value takes measurement noise for differences."""
_STRENGTH_FLOOR: Final = 0.02
"""The same for relative strength spreads."""


def measure(record: RecordTransforms) -> dict[str, float]:
    """`NAMES` -> value of one record; NaN without a known defect, or where the impacts cannot be tracked.

    `jitter_sigma`, `walk_sigma` in impact spacings; `scatter_sigma`, `*_depth` over the mean strength; `wander_level`
    rms relative speed; `arc_deg` as in `effects.EntryExit`; `level` log of the root energy of an impact (in the band,
    s^1/2) over frame.scale.
    """
    out = dict.fromkeys(NAMES, np.nan)
    if record.fault_order is None or not record.shaft_hz > 0 or record.x.size < 256:
        return out
    with np.errstate(all="ignore"):
        # Fourth powers are taken: beyond these levels they overflow or vanish.
        if not 1e-60 < float(np.abs(record.x).max()) < 1e60 or not record.mean_square > 0:
            return out
        _fill(record, record.fault_order, out)
    return {name: value if np.isfinite(value) else np.nan for name, value in out.items()}


def _fill(record: RecordTransforms, order: float, out: dict[str, float]) -> None:
    kinematic_hz = order * record.shaft_hz
    band = envelope_comb.band_signal(record)
    found = envelope_comb.find_comb(band, kinematic_hz)
    if found is None:
        return
    out["evidence"] = float(np.log1p(found.evidence))
    if found.evidence < envelope_comb.EVIDENCE:
        return
    course = envelope_comb.track(found, record.duration_s)
    if course is None:
        return
    out["rate_log_ratio"] = float(np.log(course.rate_hz / kinematic_hz))
    _lines(course, out)
    seen = impacts.measure_impacts(band, course)
    if seen is None:
        return
    rate = _timing(seen, course, out)
    out["rate_log_ratio"] = float(np.log(rate / kinematic_hz))
    _strengths(record, seen, rate, out)
    _level(record, band, seen, out)
    impact_pairs.measure_second_impact(record, seen, rate, out)


def _lines(course: envelope_comb.Track, out: dict[str, float]) -> None:
    """Relative levels of the tracked harmonics, and the gain of tracking at each."""
    tidy = np.maximum(course.after - course.floor * 1e-1, 0.3 * course.floor)
    share = 0.5 * np.log(tidy / np.nansum(tidy))
    for k in range(4):
        out[f"harmonic_{k + 1}"] = float(share[k])
    known = np.isfinite(share)
    if known.sum() >= 3:
        out["harmonic_slope"] = float(np.polyfit(np.arange(4)[known], share[known], 1)[0])
    for k in range(3):
        gain = (course.after[k] + course.floor[k]) / (course.before[k] + course.floor[k])
        out[f"smear_{k + 1}"] = float(np.log(gain))


def _timing(seen: impacts.Impacts, course: envelope_comb.Track, out: dict[str, float]) -> float:
    """Features of the impact times; returns the mean impact rate, Hz."""
    number, weight = seen.number, seen.strength**2
    weight = np.minimum(weight, 4 * medians(weight))
    # Impacts below the noise have no time.
    sure = seen.strength**2 > max(4 * seen.noise, 0.3 * float(np.mean(seen.strength**2)))
    if sure.sum() < 8:
        return course.rate_hz
    own = np.where(sure, weight, 0.0)
    slope, start = np.polyfit(number, seen.time_s, 1, w=np.sqrt(own))
    rate = float(1 / slope)
    if not abs(np.log(rate / course.rate_hz)) < 0.02:
        rate, start = course.rate_hz, float(np.average(seen.time_s - number / course.rate_hz, weights=own))
    late = (seen.time_s - start) * rate - number
    error = seen.time_error_s * rate
    if np.isfinite(course.window_passes):
        # The ends of the track give the mean of a wandering rate better than a straight line does.
        few = max(seen.number.size // 40, 1)
        rate = float((number[-few:].mean() - number[:few].mean()) / (seen.time_s[-few:] - seen.time_s[:few]).mean())
        if not abs(np.log(rate / course.rate_hz)) < 0.02:
            rate = course.rate_hz
    spreads, noises, lags = [], [], np.array([1, 2, 3, 4, 6])
    for lag in lags:
        spreads.append(_second_difference(late, own, lag))
        noises.append(_second_difference(error, own, lag))
    spread = np.array(spreads)
    if not np.isfinite(spread).all():
        return rate
    # V(l) = 6 white + 2 l walk + l^4 curvature: by least squares with relative weights, none negative.
    noise_white = float(np.average(error**2, weights=own))
    basis = np.stack((np.full(lags.size, 6.0), 2.0 * lags, lags**4.0), axis=1) / np.maximum(spread, 1e-18)[:, None]
    scale = basis.max(axis=0)
    parts = nnls(basis / scale, np.ones(lags.size))[0] / scale
    white, walk = float(parts[0]), float(parts[1])
    out["timing_log_1"] = 0.5 * float(np.log(spread[0] / 6 + _TIMING_FLOOR**2))
    out["timing_excess"] = float(np.log((spread[:2].sum() + 1e-10) / (max(noises[0] + noises[1], 0.0) + 1e-10)))
    out["timing_log_4"] = 0.5 * float(np.log(spread[3] / 6 + _TIMING_FLOOR**2))
    out["timing_growth"] = float(np.log((spread[3] + 6 * _TIMING_FLOOR**2) / (spread[0] + 6 * _TIMING_FLOOR**2)))
    clean = max(white - noise_white, 0.0)
    out["jitter_sigma"], out["jitter_log"] = float(np.sqrt(clean)), 0.5 * float(np.log(clean + _TIMING_FLOOR**2))
    out["walk_sigma"], out["walk_log"] = float(np.sqrt(walk)), 0.5 * float(np.log(walk + (0.3 * _TIMING_FLOOR) ** 2))
    _wander(late, number, own, rate, white, walk, out)
    return rate


def _second_difference(late: Array, weight: Array, lag: int) -> float:
    """Weighted mean square of late[n + l] - 2 late[n] + late[n - l]."""
    if late.size < 2 * lag + 3:
        return np.nan
    value = late[2 * lag :] - 2 * late[lag:-lag] + late[: -2 * lag]
    together = np.minimum(np.minimum(weight[2 * lag :], weight[lag:-lag]), weight[: -2 * lag])
    total = float(together.sum())
    return float((together * value**2).sum() / total) if total > 0 else np.nan


def _wander(
    late: Array, number: Array, weight: Array, rate: float, white: float, walk: float, out: dict[str, float]
) -> None:
    """Slow variation of the rate: its rms and how fast it goes, from the periodogram of the passes' durations."""
    sure = weight > 0
    steps = np.diff(np.interp(number, number[sure], late[sure]))
    n = steps.size
    power = np.abs(np.fft.rfft(steps - steps.mean())) ** 2 * (2 / n**2)
    frequency = np.arange(power.size) / n
    expected = (2 / n) * (4 * np.sin(np.pi * frequency) ** 2 * white + walk)
    slow = (frequency > 0) & (frequency * rate < 12.0) & (frequency < 0.2)
    if not slow.any():
        return
    excess = power[slow] - expected[slow]
    level = float(excess.sum())
    out["wander_level"] = float(np.sqrt(max(level, 0.0)))
    out["wander_log"] = 0.5 * float(np.log(max(level, 0.0) + 5e-4**2))
    # A bandwidth is defined only where there is wander: cosines spread evenly below it have their centroid near 0.525.
    if level > 3 * float(expected[slow].sum()) / np.sqrt(slow.sum()) and level > 1e-6:
        positive = np.maximum(excess, 0.0)
        centroid = float((positive * frequency[slow]).sum() / max(float(positive.sum()), 1e-300)) * rate
        # Taking out the mean and the width of a bin both raise the centroid, by about 0.6 bins.
        out["wander_bandwidth_hz"] = max(centroid - 0.6 * rate / n, 0.2 * rate / n) / 0.525


def _strengths(record: RecordTransforms, seen: impacts.Impacts, rate: float, out: dict[str, float]) -> None:
    """Modulation at shaft and cage rate, and random scatter beyond modulation and noise."""
    strength, number = seen.strength, seen.number
    mean = float(strength.mean())
    if not mean > 0 or strength.size < 12:
        return
    relative = strength / mean
    noise = 0.5 * seen.noise / mean**2
    bearing, fault = record.bearing, str(record.condition.fault)
    turns, order = {"shaft": 1.0, "cage": bearing.ftf}, bearing.fault_order(fault)
    columns = [np.ones_like(relative)]
    found: dict[str, float] = {}
    slots: dict[str, int] = {}
    # The cage's rate per pass is all but fixed; the shaft's moves with slip by up to a few per cent.
    for name, of_shaft in turns.items():
        per_pass = of_shaft / order
        if not per_pass < 0.45:
            continue  # above the Nyquist rate of passes
        slots[name] = len(columns)
        place, columns_here = _line(relative, number, per_pass, 0.0 if (name, fault) == ("cage", "outer") else 0.03)
        found[name] = place
        columns += columns_here
    design = np.stack(columns, axis=1)
    weights, *_ = np.linalg.lstsq(design, relative, rcond=None)
    rest = relative - design @ weights
    # Energies less the noise are unbiased for faint impacts; (1 + d cos)^2 has lines of 2 d and d^2 / 2.
    faint = strength**2 - float(np.mean((seen.strength_clean + seen.strength_error) ** 2 - seen.strength_clean**2))
    energies, *_ = np.linalg.lstsq(design, faint, rcond=None)
    free = max(relative.size - design.shape[1], 1)
    variance = float((rest**2).sum() / free)
    for name, slot in slots.items():
        square = float((weights[slot : slot + 2] ** 2).sum())
        ratio = float(np.hypot(*energies[slot : slot + 2])) / max(float(energies[0]), 1e-300)
        depth = (1 - np.sqrt(max(1 - min(ratio, 1.4) ** 2 / 2, 0.0))) * 2 / max(ratio, 1e-9)
        # Noise and scatter add to two coefficients, the more where the line was searched.
        out[f"{name}_depth"] = float(np.sqrt(max(depth**2 - 5 * variance / relative.size, 0.0)))
        out[f"{name}_line_log"] = 0.5 * float(np.log(square + _STRENGTH_FLOOR**2))
        if turns[name] == bearing.side_line_order(fault):  # at this rate a load zone modulates the defect
            out["zone_depth"] = out[f"{name}_depth"]
        if name == "shaft" and square > 30 * variance / relative.size:
            out["shaft_log_ratio"] = float(np.log(found[name] * rate / record.shaft_hz))
    clean = max(variance - noise, 0.0)
    out["scatter_sigma"] = float(np.sqrt(clean))
    out["scatter_log"] = 0.5 * float(np.log(clean + _STRENGTH_FLOOR**2))
    out["scatter_excess"] = float(np.log((variance + 1e-6) / (noise + 1e-6)))
    deviation = rest / max(np.sqrt(variance), 1e-12)
    out["strength_skew"] = float(np.cbrt(np.mean(deviation**3)))
    out["strength_kurtosis"] = float(np.log(max(float(np.mean(deviation**4)), 1e-3) / 3))
    out["strength_neighbours"] = float(np.mean(deviation[1:] * deviation[:-1]))


def _line(values: Array, number: Array, per_pass: float, width: float) -> tuple[float, list[Array]]:
    """The strongest line within `width` (relative) of a frequency, per pass; its cosine and sine at the passes."""
    near = np.array([per_pass])
    if width > 0:
        half = max(width * per_pass, 1e-9)
        count = int(np.clip(np.ceil(4 * half * (number[-1] + 1)), 1, 200))
        near = per_pass + half * np.linspace(-1, 1, 2 * count + 1)
    turns = np.exp(-2j * np.pi * near[:, None] * number)
    power = np.abs(turns @ (values - values.mean())) ** 2
    best = int(power.argmax())
    if 0 < best < near.size - 1:
        left, middle, right = power[best - 1 : best + 2]
        shift = float(np.clip(0.5 * (right - left) / max(2 * middle - left - right, 1e-300), -0.5, 0.5))
        place = float(near[best] + shift * (near[1] - near[0]))
    else:
        place = float(near[best])
    angle = 2 * np.pi * place * number
    return place, [np.cos(angle), np.sin(angle)]


def _level(
    record: RecordTransforms, band: envelope_comb.BandSignal, seen: impacts.Impacts, out: dict[str, float]
) -> None:
    """Level of the impacts over the healthy RMS, and over the noise between impacts."""
    energy = float(np.mean(seen.strength**2) - seen.noise)
    energy = max(energy, 1e-3 * float(np.mean(seen.strength**2)))
    # Per second of the cycle at 1 kHz: a length that does not depend on rates makes the level dimensionless.
    scale = record.frame.scale**2 * band.fs_hz / 1000
    out["level"] = 0.5 * float(np.log(energy / max(scale, 1e-300)))
    out["snr"] = 0.5 * float(np.log(energy / max(seen.noise, 1e-6 * energy)))
    out["phase_lock"] = seen.phase_locked
