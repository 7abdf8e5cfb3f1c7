"""Names of the lines of a `line_spectrum`: mains, shaft, this bearing, a drive, another bearing, or unknown.

lines in Hz and in orders --multiples of known rates, pairs around a carrier--> kind -> places
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from twingap.bearing import PUBLIC_BEARINGS, Bearing
from twingap.effects import LineSpectrum

MAINS: Final = "mains"
SHAFT: Final = "shaft"
OWN_BEARING: Final = "this bearing"
DRIVE: Final = "drive or inverter"
OTHER_BEARING: Final = "another bearing"
UNKNOWN: Final = "unknown"

_SAME: Final = 0.004
"""Relative distance up to which two places are one. A larger value names more lines, and more of them by chance."""
_AT_ONCE: Final = 0.015
"""Distance from once a turn up to which a line is that: nothing else turns so nearly at the shaft's rate."""
_MOST_MULTIPLES: Final = 20
"""Largest multiple of a rate that is named after it: higher ones lie near something by chance."""
_FEWEST: Final = 3
"""Lines of another bearing's family, one of them its first, from which it is named."""
_CARRIER_HZ: Final = 1000.0
"""Frequency from which a pair of lines that are fixed in Hz is taken for a drive's carrier."""
_PAIR_ORDERS: Final = 8.0
"""Largest distance, in shaft orders, of the lines of such a pair."""


def named_lines(effect: LineSpectrum, bearing: Bearing, shaft_hz: float) -> Mapping[str, tuple[float, ...]]:
    """Places of the lines by what they are: Hz for mains and drives, shaft orders for what turns.

    Lines fixed in Hz that no kind fits are under "unknown", in Hz; so are those in orders, in orders. `shaft_hz` is the
    mean shaft rate of records of the bearing under test.
    """
    out: dict[str, list[float]] = {}
    for place in effect.frequencies_hz:
        mains = any(_multiple(place, rate) for rate in (50.0, 60.0))
        out.setdefault(MAINS if mains else DRIVE if _paired(place, effect, shaft_hz) else UNKNOWN, []).append(place)
    if effect.carriers_hz:
        about = zip(effect.carriers_hz, effect.carrier_orders, strict=True)
        out.setdefault(DRIVE, []).extend(carrier + order * shaft_hz for carrier, order in about)
    left = []
    for place in effect.orders:
        if _multiple(place, 1.0) or abs(place - 1) < _AT_ONCE:
            out.setdefault(SHAFT, []).append(place)
        elif any(_multiple(place, order) for order in _orders(bearing)):
            out.setdefault(OWN_BEARING, []).append(place)
        else:
            left.append(place)
    for name, other in PUBLIC_BEARINGS.items():
        for order in _orders(other)[1:]:
            family = [place for place in left if _multiple(place, order)]
            if len(family) >= _FEWEST and any(abs(place / order - 1) < _SAME for place in family):
                out.setdefault(f"{OTHER_BEARING} ({name})", []).extend(family)
                left = [place for place in left if place not in family]
    if left:
        out.setdefault(UNKNOWN, []).extend(left)
    return {kind: tuple(sorted(places)) for kind, places in sorted(out.items(), key=lambda item: -len(item[1]))}


def _orders(bearing: Bearing) -> tuple[float, ...]:
    """FTF, BPFO, BPFI and twice BSF."""
    return (bearing.ftf, *(bearing.fault_order(fault) for fault in ("outer", "inner", "ball")))


def _multiple(place: float, rate: float) -> bool:
    """Whether a place is one of the first multiples of a rate."""
    number = round(place / rate)
    return 1 <= number <= _MOST_MULTIPLES and abs(place / (number * rate) - 1) < _SAME / max(number, 1) ** 0.5


def _paired(place: float, effect: LineSpectrum, shaft_hz: float) -> bool:
    """Whether another line fixed in Hz lies a few shaft orders away, both high enough for a carrier."""
    apart = (abs(other - place) for other in effect.frequencies_hz)
    return place >= _CARRIER_HZ and any(0 < distance < _PAIR_ORDERS * shaft_hz for distance in apart)
