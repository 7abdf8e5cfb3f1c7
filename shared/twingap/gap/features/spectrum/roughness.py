"""Features of cyclostationary noise: noise modulated once a turn, and modulation that no rotation explains.

record without tones --> squared envelope --> lines at 1x and 2x, free lines, slow modulation

A pair of tones makes an envelope line too, so tones are taken out first. Source: Antoni & Randall 2003,
doi:10.1115/1.1569940 (second-order cyclostationarity).
"""

from __future__ import annotations

import math

import numpy as np

from twingap.gap.features.spectrum.without_tones import without_tones
from twingap.gap.features.tones.envelope_lines import envelope_lines, explained
from twingap.gap.features.tones.tones import SEARCH, Lines, lines_of
from twingap.signal.record_transforms import RecordTransforms


def measure_roughness(record: RecordTransforms, out: dict[str, float]) -> None:
    """Fill the features of envelope lines at shaft rate that no pair of tones makes."""
    lines, clean = lines_of(record), without_tones(record)
    reach = 0.002 if lines.locked else SEARCH
    raw = envelope_lines(record.envelope, lines.shaft_hz)
    if raw is not None:
        out["envelope_1x"] = float(raw.at(np.array([lines.shaft_hz]), reach)[0][0])
    own = raw if clean is record else envelope_lines(clean.envelope, lines.shaft_hz)
    if own is not None:
        logs, power = own.at(lines.shaft_hz * np.array([1.0, 2.0]), reach)
        out["rough_1x"], out["rough_2x"] = float(logs[0]), float(logs[1])
        if np.isfinite(power[0]):
            place = min(round(lines.shaft_hz / own.df_hz), own.floor.size - 1)
            above = max(float(power[0]) - 2 * float(own.floor[place]), 1e-8)
            out["rough_depth"] = 0.5 * math.log10(2 * above)
            if logs[0] > 0.7:
                out["rough_ratio_log"] = _peak_deviation(own, lines.shaft_hz, reach)
    full = envelope_lines(clean.envelope_in(0.02 * record.fs_hz, 0.48 * record.fs_hz), lines.shaft_hz)
    if full is not None:
        out["rough_1x_full"] = float(full.at(np.array([lines.shaft_hz]), reach)[0][0])
    if own is not None:
        _free_modulation(record, own, out)


def _peak_deviation(lines: Lines, hz: float, reach: float) -> float:
    """ln of the strongest peak's frequency near `hz` over it; NaN without one."""
    near = np.flatnonzero(np.abs(lines.peaks.hz / hz - 1) < reach + lines.df_hz / hz)
    if near.size == 0:
        return math.nan
    return math.log(float(lines.peaks.hz[near[int(np.argmax(lines.peaks.excess[near]))]]) / hz)


def _free_modulation(record: RecordTransforms, own: Lines, out: dict[str, float]) -> None:
    """The strongest envelope line that no rotation explains, and the power of slow modulation."""
    free = own.peaks.of(~explained(record, own.peaks.hz, own.df_hz))
    best = int(np.argmax(free.excess)) if len(free) else -1
    out["modulation_free"] = math.log10(float(free.excess[best]) / 20) + 0.3 if best >= 0 else 0.0
    if best >= 0:
        out["modulation_free_hz_log"] = math.log10(float(free.hz[best]))
    slow = own.tones[1 : max(min(int(0.3 * own.stated_hz / own.df_hz), 40), 4)]
    out["modulation_slow"] = math.log10(max(float(slow.mean() / own.floor[: slow.size].mean()), 1e-3))
