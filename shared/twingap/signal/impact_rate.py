"""Rate of a fault's impacts, read from the comb of its lines in the spectra of several records.

records --spectra over their floors, lines of the shaft left out--> heights at multiples of each rate near the kinematic
one --mean over multiples and records--> the rate that stands out, or none
"""

from __future__ import annotations

from typing import Final

import numpy as np
import scipy.fft

from twingap.records import Array, Record, RecordSet
from twingap.signal.record_transforms import local_floor, medians

_WIDEST: Final = 0.02
"""Relative distance from the kinematic rate within which it is sought. A larger value finds more by chance."""
_MULTIPLES: Final = 40
"""Multiples of the rate that count. More place it more exactly, unless jitter smears the high ones."""
_CAP: Final = 4.0
"""Cap of the ln of a line's power over the floor, so that no single line makes a comb."""
_SHOWN: Final = 5.5
"""Deviates by which a rate has to stand out. A smaller value finds more rates, some by chance."""
_ALONE: Final = 0.7
"""Part of that height that rates elsewhere may reach. A larger value is less sure which of two is right."""
_BESIDE: Final = 0.002
"""Relative distance from which a rate lies elsewhere."""
_LONGEST: Final = 1 << 18
"""Samples of a record that are used. More resolve closer rates and take longer."""
_SHAFT_BINS: Final = 1.5
"""Bins about a multiple of the shaft's rate that are left out."""
_SPEED_ERROR: Final = 0.0006
"""Relative error of stated speeds, by which these lines may be off. A larger value leaves out more."""


def rate_ratio(records: RecordSet, order: float) -> float:
    """Rate of a fault's impacts over the kinematic one at the stated speeds; NaN where none stands out.

    Parameters
    ----------
    records : RecordSet
        Of one bearing with this fault.
    order : float
        Kinematic impacts per shaft turn, see `Bearing.fault_order`.

    Returns
    -------
    float
        Between 0.98 and 1.02.
    """
    spectra = [_heights(record) for record in records]
    rates_hz = [order * c.speed_rpm / 60 for c in records.conditions]
    tops = [0.48 * c.fs_hz / (1 + _WIDEST) for c in records.conditions]
    counts = [min(_MULTIPLES, int(top / rate)) for top, rate in zip(tops, rates_hz, strict=True)]
    if not spectra or min(counts) < 1:
        return float("nan")
    step = min(0.5 * df_hz / (count * rate) for (_, df_hz), rate, count in zip(spectra, rates_hz, counts, strict=True))
    ratios = np.arange(1 - _WIDEST, 1 + _WIDEST, step)
    total = np.zeros(ratios.size)
    for (heights, df_hz), rate, count in zip(spectra, rates_hz, counts, strict=True):
        bins = np.rint(ratios[:, None] * np.arange(1, count + 1) * (rate / df_hz)).astype(np.int64)
        total += np.max([heights[bins + k] for k in (-1, 0, 1)], axis=0).mean(axis=1)
    total -= medians(total)
    total /= max(1.4826 * float(medians(np.abs(total))), 1e-9)
    best = int(np.argmax(total))
    elsewhere = float(total[np.abs(ratios - ratios[best]) > _BESIDE].max(initial=0.0))
    if total[best] < _SHOWN or elsewhere > _ALONE * total[best]:
        return float("nan")
    return float(ratios[best])


def _heights(record: Record) -> tuple[Array, float]:
    """[bins] ln of a record's power (Hann) over its floor, 0 to `_CAP`, 0 at the shaft's lines; and Hz per bin."""
    x = np.asarray(record.samples[:_LONGEST], float)
    power = np.square(np.abs(scipy.fft.rfft((x - x.mean()) * np.hanning(x.size))))
    heights = np.clip(np.log(power / np.maximum(local_floor(power), 1e-300) + 1e-300), 0, _CAP)
    df_hz = record.condition.fs_hz / x.size
    places_hz = np.arange(heights.size) * df_hz
    shaft_hz = record.condition.speed_rpm / 60
    off = np.abs(places_hz - np.rint(places_hz / shaft_hz) * shaft_hz)
    heights[off < _SHAFT_BINS * df_hz + _SPEED_ERROR * places_hz] = 0.0
    return np.asarray(heights), df_hz
