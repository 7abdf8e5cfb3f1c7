"""Features of tones in the raw spectrum: shaft, mains, gear, waviness, and tones that none of these explain.

Lines (tones) --> integer and half orders, mains, gear, waviness
         |
         +--> the rest: free tones, pairs about them

Excesses are log10 of power over the local floor, levels log10 of amplitude over the healthy RMS.
Source: Randall, Vibration-based condition monitoring, Wiley 2011.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.tones.tones import HIGHEST_ORDER, LOCKED, PEAK, SEARCH, SLIP, Lines, lines_of
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms

_INTEGER: Final = (1, 2, 3, 4, 5)
_HALF: Final = (0.5, 1.5, 2.5, 3.5, 4.5)

NAMES: Final[tuple[str, ...]] = (
    "shaft_ratio_log", "shaft_lock", *(f"order_{k}_excess" for k in _INTEGER), *(f"order_{k}_level" for k in _INTEGER),
    *(f"half_{k}_excess" for k in range(1, 6)), "half_mean", "half_level", "order_high_mean", "order_high_level",
    "order_decay", "mains_50_mean", "mains_60_mean", *(f"mains_50_{k}_excess" for k in (1, 2, 3)),
    *(f"mains_60_{k}_excess" for k in (1, 2, 3)), "mains_peaks_50", "mains_peaks_60", "mains_level", "mains_decay",
    "mains_is_60", "gear_score", "gear_teeth", "gear_level", "gear_depth_log", "gear_decay",
    *(f"wave_{race}_{what}" for race in ("outer", "inner") for what in ("score", "ratio_log", "level", "decay")),
    "fault_comb_peaks", "fault_comb_share", "fault_ratio_log", "fault_low_excess", "comb_score", "comb_order",
    "comb_level", "free_count_log", "free_share",
    *(f"free_{i}_{what}" for i in (1, 2) for what in ("excess", "level", "hz_log", "fs")), "pair_score", "pair_level",
    "pair_depth_log", "pair_hz_log", "pair_fs", "pair_side_order", "pair_off_order", "peaks_log", "tonal_share",
)  # fmt: skip
"""Keys of `measure`."""


def measure(record: RecordTransforms) -> dict[str, float]:
    """`NAMES` -> value of one record; NaN where a feature does not apply."""
    out = dict.fromkeys(NAMES, math.nan)
    if record.x.size < 64 or not np.isfinite(record.mean_square) or record.mean_square <= 0:
        return out
    lines, scale = lines_of(record), max(record.frame.scale, 1e-300)
    out["shaft_ratio_log"] = math.log(lines.lock[0]) if lines.locked else 0.0
    out["shaft_lock"] = lines.lock[1]
    base, strength, alien = lines.unrelated_comb
    out["comb_score"] = strength
    if strength > 0:
        out["comb_order"] = base / lines.shaft_hz
        out["comb_level"] = _level(float(lines.peaks.power[alien].sum()), scale)
    known = lines.fault_comb[2] | lines.of_mains | alien
    waves = _waviness(record, lines, scale, out)
    _orders(lines, scale, out, known | waves)
    _mains(lines, scale, out)
    known |= waves
    taken = known | (lines.on_comb(lines.shaft_hz / 2, highest=42) if lines.locked else _near_orders(lines))
    taken |= _gear(lines, scale, out, known)
    _pair(lines, record.fs_hz, scale, out, taken)
    total = max(record.mean_square, 1e-300)
    ratio, beyond, own = lines.fault_comb
    out["fault_comb_peaks"] = math.log1p(beyond) if record.fault_order is not None else math.nan
    if record.fault_order is not None:
        out["fault_comb_share"] = min(float(lines.peaks.power[own].sum()) / total, 1.0)
        out["fault_ratio_log"] = math.log(ratio) if math.isfinite(ratio) else math.nan
        base = record.fault_order * lines.stated_hz * (ratio if math.isfinite(ratio) else 1.0)
        out["fault_low_excess"] = _mean(lines.at(base * np.arange(1.0, 4.0), 0.002)[0])
    free = lines.peaks.of(~taken)
    out["free_count_log"] = math.log1p(len(free))
    out["free_share"] = min(float(free.power.sum()) / total, 1.0)
    strongest = np.argsort(free.power)[::-1]
    for i in (1, 2):
        if len(free) >= i:
            place = int(strongest[i - 1])
            out[f"free_{i}_excess"] = math.log10(free.excess[place])
            out[f"free_{i}_level"] = _level(free.power[place], scale)
            out[f"free_{i}_hz_log"] = math.log10(free.hz[place])
            out[f"free_{i}_fs"] = float(free.hz[place]) / record.fs_hz
        else:
            out[f"free_{i}_excess"] = math.log10(PEAK)
    out["peaks_log"] = math.log1p(len(lines.peaks))
    out["tonal_share"] = min(float(lines.peaks.power.sum()) / total, 1.0)
    return out


def _near_orders(lines: Lines) -> NDArray[np.bool_]:
    """Peaks that the first three shaft orders may explain where the speed is only known within `SEARCH`."""
    order = lines.peaks.hz / lines.stated_hz
    k = np.clip(np.rint(order), 1, 3)
    return np.asarray(np.abs(order / k - 1) < 0.01)


def _orders(lines: Lines, scale: float, out: dict[str, float], without: NDArray[np.bool_]) -> None:
    """Fill the features of integer and half orders of the shaft."""
    relative = 0.001 if lines.locked else SEARCH
    orders = np.arange(1.0, 11.0)
    logs, p = lines.at(orders * lines.shaft_hz, relative, without)
    levels = _levels(p, scale)
    for k in _INTEGER:
        out[f"order_{k}_excess"], out[f"order_{k}_level"] = float(logs[k - 1]), float(levels[k - 1])
    out["order_high_mean"] = _mean(logs[3:])
    out["order_high_level"] = _mean(levels[3:])
    out["order_decay"] = _decay(orders, levels, logs > 0.6, 4)
    logs, p = lines.at(np.array(_HALF) * lines.shaft_hz, relative if lines.locked else 0.02, without)
    for k, value in enumerate(logs, start=1):
        out[f"half_{k}_excess"] = float(value)
    out["half_mean"] = _mean(logs)
    out["half_level"] = _mean(_levels(p, scale))


def _mains(lines: Lines, scale: float, out: dict[str, float]) -> None:
    """Fill the features of multiples of 50 and of 60 Hz."""
    k = np.arange(1.0, 7.0)
    means, found = [], []
    # Lines of the shaft or the fault are not the mains', unless the mains explains them better.
    without = (lines.fault_comb[2] | (lines.on_comb(lines.shaft_hz / 2, highest=42) & lines.locked)) & ~lines.of_mains
    for hz in (50, 60):
        logs, p = lines.at(hz * k, 0.0, without)
        for i in (1, 2, 3):
            out[f"mains_{hz}_{i}_excess"] = float(logs[i - 1])
        own = _mean(logs[: 5 if hz == 50 else 4])
        out[f"mains_{hz}_mean"] = own
        means.append(own)
        found.append((logs, p))
    out["mains_peaks_50"], out["mains_peaks_60"] = lines.mains
    out["mains_is_60"] = means[1] - means[0]
    logs, p = found[int(means[1] > means[0])]
    levels = _levels(p, scale)
    out["mains_level"] = float(levels[0])
    out["mains_decay"] = _decay(k, levels, logs > 0.8, 3)


def _waviness(record: RecordTransforms, lines: Lines, scale: float, out: dict[str, float]) -> NDArray[np.bool_]:
    """Multiples of the ball-pass orders of both races."""
    taken = np.zeros(len(lines.peaks), bool)
    reach = SLIP if lines.locked else SEARCH + SLIP / 2
    free = ~(lines.of_mains | lines.unrelated_comb[2])
    if lines.locked:
        free &= ~lines.on_comb(lines.shaft_hz / 2, highest=42)
    for race, order in (("outer", record.bearing.bpfo), ("inner", record.bearing.bpfi)):
        # The comb of a race's fault has the same lines as that race's waviness.
        own = record.condition.fault == race
        base = order * lines.shaft_hz
        ratio, strength = lines.wave(base, reach, free if own else free & ~lines.fault_comb[2])
        found = strength > 0.2
        out[f"wave_{race}_score"] = strength
        if found:
            out[f"wave_{race}_ratio_log"] = math.log(ratio)
        if strength > 0.6:
            taken |= lines.on_comb(base * ratio, highest=10)
        k = np.arange(1.0, 5.0)
        without = None if own else lines.fault_comb[2]
        logs, p = lines.at(k * base * (ratio if found else 1.0), 0.0 if found else reach / 3, without)
        levels = _levels(p, scale)
        out[f"wave_{race}_level"] = float(levels[0])
        out[f"wave_{race}_decay"] = _decay(k, levels, logs > 0.8, 2)
    return taken


def _gear(lines: Lines, scale: float, out: dict[str, float], taken: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Fill the features of a gear: an integer order with lines one order beside it, none at two or at half orders."""
    none = np.zeros(len(lines.peaks), bool)
    top = int(min(HIGHEST_ORDER, (lines.tones.size - 4) * lines.df_hz / lines.shaft_hz)) - 3
    if top < 11:
        return none
    order = lines.peaks.hz / lines.shaft_hz
    half = np.rint(2 * order)
    # Half a bin, and the error of a speed without lock.
    near = np.abs(lines.peaks.hz - half * lines.shaft_hz / 2) < 2.5 * lines.widths + lines.df_hz * 0.2
    near &= ~taken
    ladder, power = np.zeros(2 * top + 8), np.zeros(2 * top + 8)
    places = half[near].astype(int)
    inside = (places > 0) & (places < ladder.size)
    np.maximum.at(ladder, places[inside], np.log10(lines.peaks.excess[near][inside] / PEAK) + 0.3)
    np.maximum.at(power, places[inside], lines.peaks.power[near][inside])
    z = np.arange(9, top + 1)
    capped = np.minimum(ladder, 2.5)
    side = capped[2 * z - 2] + capped[2 * z + 2]
    against = capped[2 * z - 4] + capped[2 * z + 4] + capped[2 * z - 1] + capped[2 * z + 1]
    double = np.where(4 * z < ladder.size, capped[np.minimum(4 * z, ladder.size - 1)], 0.0)
    score = np.where(capped[2 * z] > 0, capped[2 * z] + side - against + 0.5 * double, 0.0)
    # Side lines are never stronger than their carrier.
    score -= 2.0 * (power[2 * z] < 0.9 * np.maximum(power[2 * z - 2], power[2 * z + 2]))
    best = int(np.argmax(score))
    out["gear_score"] = max(float(score[best]), 0.0) * min(lines.lock[1] / LOCKED, 1.0)
    if out["gear_score"] < 0.8 or min(capped[2 * z[best] - 2], capped[2 * z[best] + 2]) <= 0:
        return none
    teeth = int(z[best])
    out["gear_teeth"] = float(teeth)
    out["gear_level"] = _level(power[2 * teeth], scale)
    sides = 0.5 * (math.sqrt(power[2 * teeth - 2]) + math.sqrt(power[2 * teeth + 2]))
    out["gear_depth_log"] = math.log10(max(2 * sides / math.sqrt(power[2 * teeth]), 1e-3))
    p = lines.at(np.array([2.0 * teeth * lines.shaft_hz]))[1]
    if np.isfinite(p[0]):
        out["gear_decay"] = float(np.sqrt(p[0] / power[2 * teeth]))
    orders = half / 2
    k = np.rint(orders / teeth)
    return np.asarray(near & (k >= 1) & (np.abs(orders - k * teeth) <= 1))


def _pair(lines: Lines, fs_hz: float, scale: float, out: dict[str, float], taken: NDArray[np.bool_]) -> None:
    """Fill the features of a modulated carrier: the strongest tone with two equal ones at equal distances."""
    out["pair_score"] = 0.0
    use = ~taken
    use &= lines.peaks.hz > 6 * lines.shaft_hz
    own, widths = lines.peaks.of(use), lines.widths[use]
    if len(own) < 3:
        return
    best, found = 0.0, (0, 0, 0)
    for centre in np.argsort(own.power)[::-1][:5]:
        distance = own.hz - own.hz[centre]
        above = np.flatnonzero((distance > 0.4 * lines.shaft_hz) & (distance < 12 * lines.shaft_hz))
        below = np.flatnonzero((distance < -0.4 * lines.shaft_hz) & (distance > -12 * lines.shaft_hz))
        if not above.size or not below.size:
            continue
        miss = np.abs(distance[above][:, None] + distance[below][None, :])
        allowed = 2.0 * np.hypot(widths[above][:, None], widths[below][None, :])
        unlike = np.abs(np.log(own.power[above][:, None] / own.power[below][None, :]))
        weaker = np.minimum(own.excess[above][:, None], own.excess[below][None, :])
        score = np.where((miss < allowed) & (unlike < 2.0), np.log10(weaker / PEAK) + 0.3 - 0.2 * unlike, 0.0)
        # A carrier is not weaker than its side lines.
        score *= own.power[centre] > 0.7 * np.minimum(own.power[above][:, None], own.power[below][None, :])
        # One modulation has one pair of side lines; a comb has more at twice the distance.
        spacing = 0.5 * (distance[above][:, None] - distance[below][None, :])
        onward = np.zeros(score.shape)
        for sign in (2.0, -2.0):
            target = own.hz[centre] + sign * spacing
            at = np.clip(np.searchsorted(own.hz, target), 1, len(own) - 1)
            nearest = np.minimum(np.abs(own.hz[at] - target), np.abs(own.hz[at - 1] - target))
            onward += nearest < 1.5 * lines.df_hz
        score = np.where(onward > 0, 0.3 * score / (1 + onward), score)
        place = int(np.argmax(score))
        i, j = divmod(place, below.size)
        value = float(score[i, j]) + 0.3 * math.log10(own.excess[centre] / PEAK) if score[i, j] > 0 else 0.0
        if value > best:
            best, found = value, (int(centre), int(above[i]), int(below[j]))
    if best <= 0:
        return
    centre, high, low = found
    out["pair_score"] = best
    out["pair_level"] = _level(own.power[centre], scale)
    sides = math.sqrt(own.power[high]) + math.sqrt(own.power[low])
    out["pair_depth_log"] = math.log10(sides / math.sqrt(own.power[centre]))
    out["pair_hz_log"] = math.log10(own.hz[centre])
    out["pair_fs"] = float(own.hz[centre]) / fs_hz
    out["pair_side_order"] = float(own.hz[high] - own.hz[low]) / 2 / lines.shaft_hz
    order = float(own.hz[centre]) / lines.shaft_hz
    out["pair_off_order"] = abs(order - round(order))


def _decay(k: Array, levels: Array, strong: NDArray[np.bool_], fewest: int) -> float:
    """Factor of the amplitude from line to line, by a line through the strong ones; NaN with fewer than `fewest`."""
    if np.count_nonzero(strong) < fewest:
        return math.nan
    return float(10 ** np.polyfit(k[strong], levels[strong], 1)[0])


def _levels(power: Array, scale: float) -> Array:
    return np.asarray(np.log10(np.sqrt(2 * np.maximum(power, 1e-300)) / scale))


def _level(power: float, scale: float) -> float:
    return math.log10(max(math.sqrt(2 * power) / scale, 1e-9))


def _mean(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else math.nan
