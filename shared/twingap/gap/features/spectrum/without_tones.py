"""A record without its tones: the noise beneath the lines.

transform --bins of peaks reduced to the floor, those of the fault kept--> RecordTransforms, made once
"""

from __future__ import annotations

import math

import numpy as np

from twingap.gap.features.tones.tones import lines_of
from twingap.signal.record_transforms import RecordTransforms, once_a_record


def without_tones(record: RecordTransforms) -> RecordTransforms:
    """The record with its tones' bins taken out, but for those of the fault; the record itself where it has none."""
    return _cleaned(record) if np.any(~lines_of(record).fault_comb[2]) else record


@once_a_record
def _cleaned(record: RecordTransforms) -> RecordTransforms:
    lines = lines_of(record)
    own = lines.peaks.of(~lines.fault_comb[2])
    clean = RecordTransforms(record.x, record.condition, record.frame)
    spectrum = record.transform.copy()
    places = np.rint(own.hz / record.df_hz).astype(int)
    # A tone without window leaks: the stronger, the more bins are reduced.
    reach = np.clip(np.sqrt(own.excess) / 6, 2, 12).astype(int)
    for place, width in zip(places, reach, strict=True):
        low, high = max(place - width, 0), min(place + width + 1, spectrum.size)
        floor = math.sqrt(lines.floor[min(place, lines.floor.size - 1)] * record.x.size**2 / 3)
        part = spectrum[low:high]
        spectrum[low:high] = part * np.minimum(1.0, floor / np.maximum(np.abs(part), 1e-300))
    clean.__dict__["transform"] = spectrum  # in place of the cached property's own
    return clean
