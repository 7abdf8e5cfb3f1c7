"""The record without its tones: what lies beneath the lines.

transform --bins of peaks down to their floor, those of the fault kept--> RecordView, made once
"""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.tones.tones import lines_of
from twingap.signal.record_transforms import RecordView

Array = NDArray[np.float64]

_CLEAN: WeakKeyDictionary[RecordView, RecordView] = WeakKeyDictionary()


def without_tones(view: RecordView) -> RecordView:
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
