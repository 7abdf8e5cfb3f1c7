"""Features of converter and recording: clipping, quantisation and missing stretches.

samples --> largest and smallest --> visits of them, over those of the levels just inside --> clipping
        --> sorted distinct values --> smallest differences --> step of a grid -----------> quantisation
        --> runs of equal samples, less those at the rails and those due to a grid -------> dropout

Source: IEEE Std 1057, Digitizing waveform recorders; Little & Rubin 2019, Statistical analysis with missing data.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, medians

NAMES: Final[tuple[str, ...]] = (
    "clip_excess", "clip_fraction_log", "clip_rail_log", "clip_both", "clip_repeats", "clip_offset", "peak_to_peak_log",
    "grid_step_log", "grid_step_rms_log", "grid_misfit", "grid_distinct_log", "grid_repeats", "gap_rate_log",
    "gap_fraction_log", "gap_length_log", "gap_longest_log", "gap_jump", "gap_weight",
)  # fmt: skip
"""Keys of `measure`."""
FINEST: Final = 3e-3
"""Smallest step over the healthy RMS that is distinguished: about 16 bits. A smaller value makes features sensitive to
fine converters."""
_SHORTEST: Final = 4
"""Smallest number of equal samples in a row that count as a gap. A larger value misses short gaps."""


def measure(record: RecordTransforms) -> dict[str, float]:
    """`NAMES` -> value of one record; NaN where a feature does not apply."""
    out = dict.fromkeys(NAMES, math.nan)
    x, scale = record.x, max(record.frame.scale, 1e-300)
    if x.size < 64 or not np.isfinite(x).all():
        return out
    high, low = float(x.max()), float(x.min())
    span = high - low
    # Largest difference of equal values after unit conversions in single precision.
    same = max(4e-7 * max(abs(high), abs(low)), 1e-300)
    if span <= 8 * same:
        return out
    rms = max(math.sqrt(record.mean_square), 1e-300)
    begins = np.flatnonzero(np.concatenate(([True], np.abs(np.diff(x)) > same)))
    lengths = np.diff(np.append(begins, x.size))
    runs = x[begins]
    step, misfit, distinct = grid(runs, same)
    gridded = misfit < 0.1 and step > 0
    out["grid_misfit"] = misfit
    out["grid_step_log"] = math.log10(max(step / scale, FINEST) if gridded else FINEST)
    out["grid_step_rms_log"] = math.log10(max(step / rms, FINEST) if gridded else FINEST)
    out["grid_distinct_log"] = math.log10(distinct / runs.size)
    out["grid_repeats"] = float(np.count_nonzero(lengths > 1)) / runs.size
    clipped = _clipping(x, runs, high, low, same, step if gridded else 0.0, scale, out)
    _gaps(record, runs, lengths, (high, low) if clipped else None, same, step if gridded else 0.0, rms, out)
    return out


def grid(values: Array, same: float) -> tuple[float, float, int]:
    """Step of the grid that values lie on; rms distance of the values' differences from integer multiples of it, in
    steps (0.29 where there is no grid); number of distinct values, those closer than `same` being one."""
    ordered = np.sort(values)
    differences = np.diff(ordered)
    differences = differences[differences > 2 * same]
    distinct = differences.size + 1
    if distinct < 3:
        return (float(differences[0]) if differences.size else 0.0), 0.0, distinct
    # Differences between values of a grid are multiples of its step: the smallest ones give it, before rounding of
    # larger multiples adds up.
    small = np.partition(differences, differences.size // 20)[: max(differences.size // 20, 2)]
    step = float(medians(small[small < 1.5 * small.min()]))
    near = differences[differences < 20.5 * step]
    if near.size > 1:
        k = np.rint(near / step)
        step = float((k @ near) / (k @ k))
        misfit = float(np.sqrt(np.mean((near / step - np.rint(near / step)) ** 2)))
    else:
        misfit = 0.29
    # Distances of a few rounding errors show no grid.
    if step < 50 * same:
        misfit = max(misfit, 0.29)
    return step, misfit, distinct


def _clipping(
    x: Array, runs: Array, high: float, low: float, same: float, step: float, scale: float, out: dict[str, float]
) -> bool:
    """Fill the features of clipping, from counts of extremes and of a strip inside them; True for a clipped record."""
    span = high - low
    strip = max(0.02 * span, 1.5 * step)
    at_high, at_low = runs >= high - same, runs <= low + same
    inside_high = int(np.count_nonzero(~at_high & (runs >= high - strip)))
    inside_low = int(np.count_nonzero(~at_low & (runs <= low + strip)))
    n_high, n_low = int(np.count_nonzero(at_high)), int(np.count_nonzero(at_low))
    both = np.count_nonzero(np.abs(x - high) <= same) + np.count_nonzero(np.abs(x - low) <= same)
    # A density that falls outwards fills the strip more than the extreme itself.
    sides = (math.log10((n_high + 0.5) / (inside_high + 1.5)), math.log10((n_low + 0.5) / (inside_low + 1.5)))
    out["clip_excess"] = 0.5 * (sides[0] + sides[1]) + 0.5 * math.log10((n_high + n_low) / 2)
    out["clip_both"] = min(sides)
    out["clip_fraction_log"] = math.log10(both / x.size)
    out["peak_to_peak_log"] = math.log10(span / 2 / scale)
    if step == 0:
        # Continuous noise never visits the same value twice.
        beyond = (n_high, n_low)
        rails = (n_high >= 2, n_low >= 2)
    else:
        beyond = (1 + max(n_high - inside_high, 0), 1 + max(n_low - inside_low, 0))
        rails = (n_high >= 5 and n_high > 1.3 * inside_high, n_low >= 5 and n_low > 1.3 * inside_low)
    out["clip_repeats"] = math.log10((beyond[0] + beyond[1]) / 2)
    if all(rails):
        out["clip_rail_log"] = math.log10(span / 2 / scale)
        out["clip_offset"] = (high + low) / span
    elif any(rails):
        out["clip_rail_log"] = math.log10(max(abs(high if rails[0] else low), 1e-300) / scale)
    return any(rails)


def _gaps(
    record: RecordTransforms,
    runs: Array,
    lengths: NDArray[np.int64],
    rails: tuple[float, float] | None,
    same: float,
    step: float,
    rms: float,
    out: dict[str, float],
) -> None:
    """Fill the features of gaps: runs of equal samples longer than quantisation makes them."""
    fs_hz, n = record.fs_hz, record.x.size
    shortest = _SHORTEST
    if step > 0:
        # Runs of quantised noise end at a constant rate; for slow signals the common long runs set the limit. A quiet
        # signal stays longest on its commonest level, whose runs a gap has to exceed.
        levels = np.rint((runs - runs[0]) / step).astype(np.int64)
        visits = np.bincount(levels - levels.min())
        common = levels == int(np.argmax(visits)) + levels.min()
        lasting = 1 - float(np.count_nonzero(common)) / float(lengths[common].sum())
        repeats = min(max(float(np.count_nonzero(lengths > 1)) / runs.size, lasting, 1e-3), 0.999)
        usual = float(np.quantile(lengths, 0.99))
        shortest = max(_SHORTEST, 1 + math.ceil(math.log(0.003 / n) / math.log(repeats)), math.ceil(3 * usual))
    held = lengths >= shortest
    if rails is not None:
        held &= (np.abs(runs - rails[0]) > same) & (np.abs(runs - rails[1]) > same)
    places = np.flatnonzero(held)
    own = lengths[places].astype(float)
    count = places.size
    duration = n / fs_hz
    out["gap_longest_log"] = math.log10(float(lengths.max()))
    out["gap_fraction_log"] = math.log10(float(own.sum()) / n + 1e-4)
    rate = count / duration
    if count:
        # Exponential lengths have no memory: the mean excess over the shortest is the mean length of a gap.
        mean = max(float(own.mean()) - shortest + 0.5, 0.5)
        out["gap_length_log"] = math.log10(mean / fs_hz)
        rate *= math.exp(min((shortest - 1.5) / mean, 2.0))
        ends = places[places + 1 < runs.size]
        if ends.size:
            # A missing stretch ends in a jump, a quiet one in a single step.
            leap = np.abs(runs[ends + 1] - runs[ends])
            out["gap_jump"] = float(np.mean(leap > max(2.5 * step, 0.05 * rms)))
            out["gap_weight"] = math.log10(float(leap.mean()) / rms + 1e-3)
    out["gap_rate_log"] = math.log10(rate + 0.1)
