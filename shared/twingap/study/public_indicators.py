"""Plain indicators of single recordings, to compare with the literature: no twin and no verdict.

recording --combs, samples at extremes, bursts, tones--> a row
signatures --compared with the other recordings of the fault--> outlying signatures
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from twingap.gap.features.registry import NAMES, measure
from twingap.identification.calibrate import CLEAR_COMB, calibrate
from twingap.identification.speed_reading import comb_heights
from twingap.records import Array, RecordSet
from twingap.signal.record_transforms import RecordTransforms
from twingap.twins.twin_file import TwinSpec

OUTLYING: Final = 6.0
"""Threshold of an outlying signature, in robust standard deviations; larger reports fewer."""
CLIPPED: Final = 4
"""Samples at one extreme from which a record counts as clipped; an unclipped record has one."""
BURST_DB: Final = 10.0
"""Level of the loudest twentieth of a record over its median, dB, in the top quarter of the band, from which it counts
as a burst; larger reports fewer."""
PLACES: Final = ("_teeth", "_hz_log", "_fs", "_order", "_ratio_log")
"""Suffixes of signatures that are positions, which are meaningless where there is no line or mode."""
ORDER_FEATURES: Final = ("lines.half_mean", "lines.order_high_mean")
"""Signatures of half orders and of high integer orders of the shaft."""


def indicators(records: RecordSet, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Plain indicators of each recording, which is the group of its records.

    Returns
    -------
    list of dict
        recording, fault, size_inch, speed_rpm; comb (height of each fault's comb, median over records), shows_fault
        (None for healthy); at_extremes (samples at one extreme, maximum over records), clipped; burst_db, bursts;
        kurtosis; half_orders, high_orders; outlying (signature -> robust deviations).
    """
    assert records.bearing is not None
    spec = TwinSpec("phenomenological", bearing=records.bearing)
    frame = calibrate(records, spec, rng).frame
    measured: dict[str, Array] = {}
    rows: list[dict[str, Any]] = []
    for group in records.groups:
        own = list(records.take(i for i, c in enumerate(records.conditions) if c.group == group))
        table = np.array([measure(RecordTransforms(r.samples, r.condition, frame)) for r in own])
        measured[group] = _medians(table)
        heights = [comb_heights(r.samples, r.condition, records.bearing) for r in own]
        comb = {fault: float(np.median([h[fault] for h in heights])) for fault in heights[0]}
        condition = own[0].condition
        at_extremes = max(_at_extremes(r.samples) for r in own)
        burst = max(burst_db(r.samples) for r in own)
        rows.append({
            "recording": group, "fault": condition.fault, "size_inch": condition.extra.get("fault_size_inch"),
            "load_hp": condition.extra.get("load_hp"), "speed_rpm": condition.speed_rpm, "comb": comb,
            "shows_fault": shows_fault(comb, str(condition.fault)),
            "at_extremes": at_extremes, "clipped": at_extremes >= CLIPPED,
            "burst_db": burst, "bursts": burst > BURST_DB,
            "kurtosis": float(np.median([_kurtosis(r.samples) for r in own])),
            "half_orders": float(measured[group][NAMES.index(ORDER_FEATURES[0])]),
            "high_orders": float(measured[group][NAMES.index(ORDER_FEATURES[1])]),
        })  # fmt: skip
    for row in rows:
        others = [measured[o["recording"]] for o in rows if o["fault"] == row["fault"] and o is not row]
        row["outlying"] = outlying(measured[row["recording"]], others, list(measured.values()))
    return rows


def shows_fault(comb: dict[str, float], fault: str) -> bool | None:
    """Whether a fault's own comb is significant and the highest; None for a state without a comb (healthy, cage)."""
    if fault not in comb:
        return None
    return comb[fault] >= CLEAR_COMB and comb[fault] == max(comb.values())


def outlying(own: Array, others: list[Array], everyone: list[Array]) -> dict[str, float]:
    """The three signatures that deviate most from those of other recordings, in robust standard deviations.

    `others` are of recordings of the same fault; with fewer than four the result is empty. Half of the spread of
    `everyone` is the least scale. All [signatures].
    """
    if len(others) < 4:
        return {}
    table, all_rows = np.array(others), np.array(everyone)
    seen = np.isfinite(own) & (np.isfinite(table).sum(axis=0) >= 4)
    centre, spread = np.full(own.size, np.nan), np.full(own.size, np.nan)
    for j in np.flatnonzero(seen):
        column = table[np.isfinite(table[:, j]), j]
        centre[j] = np.median(column)
        spread[j] = max(_spread(column), 0.5 * _spread(all_rows[np.isfinite(all_rows[:, j]), j]), 0.05)
    z = np.where(seen, (own - centre) / spread, 0.0)
    z[[name.endswith(PLACES) for name in NAMES]] = 0.0
    order = np.argsort(-np.abs(z))[:3]
    return {NAMES[j]: float(z[j]) for j in order if abs(z[j]) > OUTLYING}


def _spread(values: Array) -> float:
    """Standard deviation estimated from the median absolute deviation."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def burst_db(x: Array) -> float:
    """Level of the loudest of twenty equal segments over their median, dB, in the top quarter of the band."""
    transform = np.fft.rfft(x - x.mean())
    transform[: 3 * transform.size // 4] = 0
    top = np.fft.irfft(transform, x.size)
    levels = np.array([np.mean(part**2) for part in np.array_split(top, 20)])
    return float(10 * np.log10(max(float(levels.max()), 1e-300) / max(float(np.median(levels)), 1e-300)))


def _at_extremes(x: Array) -> int:
    """Number of samples at the highest or at the lowest value, whichever is larger."""
    return int(max(np.count_nonzero(x == x.max()), np.count_nonzero(x == x.min())))


def _kurtosis(x: Array) -> float:
    z = x - x.mean()
    return float(np.mean(z**4) / max(float(np.mean(z**2)) ** 2, 1e-300))


def _medians(table: Array) -> Array:
    """[signatures] Medians over records; NaN where all are NaN."""
    out = np.full(table.shape[1], np.nan)
    seen = np.isfinite(table).any(axis=0)
    out[seen] = np.nanmedian(table[:, seen], axis=0)
    return out
