"""Lines about the carriers of drives that the twin lacks: at shaft orders from a carrier that has no line itself.

records --strongest pair about a carrier--> its other lines --power less the twin's--> lines; again without these lines
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from twingap.effects.drive_interference import CERTAIN_PAIR
from twingap.gap.features.tones.side_pairs import SMOOTHED, line_at, log_power, strongest_pair
from twingap.gap.features.tones.whitened_spectra import whiten
from twingap.signal.record_transforms import RecordTransforms

_CARRIERS: Final = 4
"""Largest number of carriers. More take longer."""
_HIGHEST: Final = 12
"""Highest multiple of half the pair's distance at which a carrier's lines are sought."""
_SHOWN: Final = 6.0
"""z from which such a line is there. A smaller value finds weaker lines, and more by chance."""
_MASKED: Final = 3
"""Bins on either side of a line that are ignored when the next carrier is sought."""
_LOUDER: Final = 2.0
"""Power of a line over that of the twin at its place from which it is missing in the twin."""
_FEWEST_RECORDS: Final = 4
"""Records in which carriers are sought. Fewer have pairs by chance."""


class CarrierLine(NamedTuple):
    """A line at a number of shaft orders from a carrier."""

    carrier_hz: float
    order: float  # negative below the carrier
    amplitude: float  # unit of the records


def carrier_lines(real: Sequence[RecordTransforms], made: Sequence[RecordTransforms]) -> list[CarrierLine]:
    """Lines about carriers in the records that the twin's records, of the same conditions, do not have."""
    if len(real) < _FEWEST_RECORDS:
        return []
    records = [whiten(record) for record in real]
    twin = [whiten(record) for record in made]
    logs = [log_power(record) for record in records]
    lines: list[CarrierLine] = []
    for _ in range(_CARRIERS):
        pair = strongest_pair(records, logs)
        if pair is None or pair.z < CERTAIN_PAIR:
            break
        # A drive's lines are at multiples of twice the pole pairs, or of half that.
        step = pair.order / 2 if pair.order % 2 == 0 else pair.order
        most = _inside(pair.carrier_hz, real) / max(record.shaft_hz for record in real)
        for order in (sign * step * k for k in range(1, _HIGHEST + 1) for sign in (-1, 1)):
            if abs(order) > most and abs(order) != pair.order:
                continue
            z, places = line_at(records, logs, pair.carrier_hz, order)
            if z < _SHOWN and abs(order) != pair.order:
                continue
            bins = [record.bins_of(place[None]) for record, place in zip(records, places, strict=True)]
            own, other = (
                float(np.median([math.exp(float(of.level_logs(at)[0])) for of, at in zip(side, bins, strict=True)]))
                for side in (records, twin)
            )
            if own > _LOUDER * other:
                lines.append(CarrierLine(pair.carrier_hz, order, math.sqrt(2 * (own - other) / SMOOTHED)))
            for values, (at,) in zip(logs, bins, strict=True):
                values[max(at - _MASKED, 0) : at + _MASKED + 1] = 0.0
    return lines


def _inside(carrier_hz: float, records: Sequence[RecordTransforms]) -> float:
    """Largest distance of a line from a carrier, Hz, that stays between 0 and half the sampling rate."""
    return min(carrier_hz, min(r.fs_hz for r in records) / 2 - carrier_hz)
