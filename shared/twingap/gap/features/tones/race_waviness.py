"""Race waviness: tones on multiples of the ball-pass orders, in records whose defect is not of that race.

records --each at the speed of its highest score--> score at the ball-pass order, and at orders beside it
        --difference over the spread--> z
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from twingap.bearing import Bearing
from twingap.gap.features.tones.aligned_combs import aligned
from twingap.gap.features.tones.whitened_spectra import Single, Whitened
from twingap.signal.record_transforms import medians

_RACES: Final = ("outer", "inner")
_EACH: Final = ("", "_lead", "_first", "_second", "_share")
NAMES: Final = (*(f"wave_{race}{part}" for race in _RACES for part in _EACH), "wave_max", "wave_max_lead")

_BESIDE: Final = np.array([0.085, 0.1, 0.115, 0.13, 0.145, 0.16])
"""Relative distances from the ball-pass order at which the scores of chance are measured."""
_ORDERS: Final = 1 + np.concatenate(([0.0], -_BESIDE, _BESIDE))
_HARMONICS: Final = np.arange(1.0, 6.0)
_WEIGHTS: Final = np.array([1.0, 0.8, 0.6, 0.5, 0.4])
"""Weights of the harmonics, which fall off as waviness usually does: flatter ones favour other combs."""
_FREE: Final = 0.035
"""Largest relative error of the order in a healthy record, whose speed and slip are uncertain."""
_OTHER_FAULT: Final = 0.02
"""The same where another race's comb shows the speed, and only slip is uncertain."""
_EVEN: Final = 1.2
"""Least spread of one record's score without waviness: larger, and z is smaller."""


def measure(records: Sequence[Whitened], deviates: Sequence[Single], bearing: Bearing) -> dict[str, float]:
    """`NAMES` -> value of a set of records and the `deviates` [bins] of each; NaN where each has a defect of that race.

    Of each race: z of the ball-pass comb among combs beside it, how far it stands above the highest of these, mean
    deviates of its first two lines, and the part of the records in which it is the highest; z and lead of either.
    """
    out = dict.fromkeys(NAMES, math.nan)
    for race, order in zip(_RACES, (bearing.bpfo, bearing.bpfi), strict=True):
        places = [k for k, record in enumerate(records) if record.kind != race]
        if not places:
            continue
        own, their = [records[k] for k in places], [deviates[k] for k in places]
        reach = [_FREE if record.kind == "healthy" else _OTHER_FAULT for record in own]
        found = aligned(own, their, order * _ORDERS[:, None] * _HARMONICS, _WEIGHTS, reach)
        mean = found.mean()
        if not np.isfinite(mean[0]) or not np.isfinite(mean[1:]).any():
            continue
        beside = mean[1:][np.isfinite(mean[1:])]
        usual = float(medians(beside))
        spread = max(1.4826 * float(medians(np.abs(beside - usual))), _EVEN / math.sqrt(len(own)))
        first = np.nan_to_num(found.score[0], nan=-np.inf) > np.nan_to_num(found.score[1:], nan=-np.inf).max(axis=0)
        values = ((mean[0] - usual) / spread, mean[0] - beside.max(), *found.lines[0, :2], first.mean())
        out |= {f"wave_{race}{part}": float(value) for part, value in zip(_EACH, values, strict=True)}
    for part in ("", "_lead"):
        known = [out[f"wave_{race}{part}"] for race in _RACES if math.isfinite(out[f"wave_{race}{part}"])]
        out[f"wave_max{part}"] = max(known, default=math.nan)
    return out
