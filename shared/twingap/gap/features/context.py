"""Context features: numbers of records, conditions, speed correction and cage slip that other features depend on.

conditions of the records, speeds from calibration, impact rates of several faults --> context features
"""

from __future__ import annotations

from typing import Final

import numpy as np

from twingap.gap.features.group_statistics import extent
from twingap.gap.features.measured import Pair
from twingap.gap.features.registry import NAMES as RECORD_NAMES
from twingap.identification.speed import Speeds
from twingap.records import Array

NAMES: Final = (
    "records", "healthy_share", "log_samples", "log_turns", "speeds", "span_s",
    "own_simulator", "has_effects", "slip", "slip_z", "slip_decidable", "speed_z", "speed_scatter",
    "slip_free", "slip_free_z", "slip_evidence",
    "slip_measured", "slip_measured_size", "slip_measured_rest", "slip_rollers",
    "extent_1", "extent_4", "extent_13", "extent_41", "extent_121", "extent_mean",
)  # fmt: skip
"""In the order of `measure`."""
_SMALL_SLIP: Final = 1e-3
"""Slip for the numerical derivative of impact rates, and smallest slip from which the rollers' spin is computed. A
larger value leaves more spins unknown."""


def measure(pair: Pair, speeds: Speeds | None, statistics: Array, *, has_effects: bool) -> Array:
    """[NAMES] Context of one comparison; arguments as `comparison.compare`, statistics of `group_statistics`."""
    return np.concatenate((_conditions(pair, speeds, has_effects), _slip(pair), extent(statistics)))


def _conditions(pair: Pair, speeds: Speeds | None, has_effects: bool) -> Array:
    """Number, length and range of the records, kind of twin, and the speeds that calibration found."""
    conditions = pair.real.conditions
    times = [c.time_s for c in conditions if c.time_s is not None]
    rpm = np.array([c.speed_rpm for c in conditions])
    return np.array(
        [
            np.log(len(conditions)),
            np.mean([c.fault == "healthy" for c in conditions]),
            np.log(np.mean([c.n_samples for c in conditions])),
            np.log(np.mean([c.duration_s * c.speed_rpm / 60 for c in conditions])),
            np.log(rpm.max() / rpm.min()),
            np.log1p(max(times) - min(times)) if times else np.nan,
            float(pair.external),
            float(has_effects),
            *(_speeds(speeds) if speeds is not None else [np.nan] * 8),
        ]
    )


def _slip(pair: Pair) -> Array:
    """[4] Difference in cage slip from the impact rates: slip, logarithms of its size and of the residual, and the part
    of the slip that changes the rollers' spin. NaN with fewer than two faults.

    Slip changes the rate of each fault by a different factor (BPFO and BPFI in opposite directions), so that one slip
    has to explain both races. The rate of a roller defect is used only where one of the races is missing, because the
    rollers' spin does not follow from the cage.
    """
    bearing, rate = pair.real.summaries[0].frame.bearing, RECORD_NAMES.index("impacts.rate_log_ratio")
    slipped = bearing.slipped(1 - _SMALL_SLIP)
    shown = {}
    for fault in ("outer", "inner", "ball"):
        ours, theirs = (np.nanmedian(of.values[of.faults() == fault, rate]) for of in (pair.real, pair.simulated))
        if np.isfinite(ours - theirs):
            shown[fault] = ours - theirs
    if len(shown) < 2:
        return np.full(4, np.nan)
    shares = {fault: np.log(slipped[fault] / bearing.fault_order(fault)) / _SMALL_SLIP for fault in shown}
    races = [fault for fault in shown if fault != "ball" or len(shown) == 2]
    share, of_all = (np.array([values[fault] for fault in races]) for values in (shares, shown))
    slip = float(share @ of_all) / float(share @ share)
    rest = float(np.sqrt(np.mean((of_all - slip * share) ** 2)))
    settled = len(shown) == 3 and abs(slip) > _SMALL_SLIP
    spin = float(np.clip(shown["ball"] / (slip * shares["ball"]), -3, 3)) if settled else np.nan
    return np.array([slip, np.log(abs(slip) + 1e-4), np.log(rest + 1e-4), spin])


def _speeds(of: Speeds) -> list[float]:
    """Slip and errors of the stated speeds, from calibration; NaN where the records cannot show them."""
    known = np.isfinite(of.slip_sigma) and of.slip_sigma > 0
    error = np.log(max(of.common_ratio, 1e-3))
    return [
        of.slip,
        of.slip / of.slip_sigma if known else np.nan,
        float(of.decidable),
        error / of.common_sigma if np.isfinite(of.common_sigma) and of.common_sigma > 0 else np.nan,
        of.scatter,
        of.slip_free if known else np.nan,
        of.slip_free / of.slip_sigma if known else np.nan,
        of.slip_evidence if known else np.nan,
    ]
