"""Impact band: the band around a mode in which envelopes and energies of impacts are computed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twingap.bearing import Bearing
from twingap.records import Condition


def mode_band(
    resonance_hz: float, damping_ratio: float, conditions: Sequence[Condition], bearing: Bearing
) -> tuple[float, float]:
    """Impact band of a mode, Hz, wide enough for envelopes to contain harmonics of the impact rate.

    Parameters
    ----------
    resonance_hz, damping_ratio : float
        Frequency, Hz, and damping ratio of the mode.
    conditions : sequence of Condition
        Conditions of the records.
    bearing : Bearing

    Returns
    -------
    (float, float)
        Low and high edge, Hz.
    """
    top = min(c.fs_hz for c in conditions) / 2
    rate = float(np.median([impact_hz(c, bearing) for c in conditions]))
    wanted = min(4 * rate, 0.2 * top)
    # A very broad mode is usually a poor fit to several modes: the band does not follow it.
    half = max(min(3 * damping_ratio * resonance_hz, 0.12 * top), wanted)
    low, high = resonance_hz - half, resonance_hz + half
    # A mode close to either end keeps the width of its band.
    begin, end = 0.02 * top, 0.98 * top
    low, high = (begin, min(begin + 2 * half, end)) if low < begin else (low, high)
    return (max(end - 2 * half, begin), end) if high > end else (low, high)


def impact_hz(condition: Condition, bearing: Bearing) -> float:
    """Impact rate of a record's fault, Hz; that of an inner race where the fault is healthy or unknown."""
    fault = condition.fault if condition.fault not in (None, "healthy", "cage") else "inner"
    return bearing.fault_order(str(fault)) * condition.speed_rpm / 60
