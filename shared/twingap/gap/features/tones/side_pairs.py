"""Pairs of lines about a fixed carrier that has no line itself, as of a drive whose modulation suppresses it.

log spectrum of each record --highest within a tolerance, mean over records--> z of both sides, 1 to 8 orders away
    --centres without a line where the weaker side is highest--> candidates
    --both lines of each record: symmetric about the same centre?--> z of the records where they are --> best pair

Each record places its pair anew: carriers drift a little between records, and stated speeds have errors. Pairs by
chance, of lines that move with speed, have another centre in each record.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from twingap.gap.features.tones.whitened_spectra import Single, Whitened
from twingap.records import Array
from twingap.signal.record_transforms import medians

_ORDERS: Final = range(1, 9)
"""Distances of the lines from their centre, shaft orders."""
_SLACK: Final = 0.025
"""Relative error of the distance: that of the stated speed, or the slip of a motor. A larger value finds pairs at worse
speeds, and more chance pairs."""
_DRIFT: Final = 0.0005
"""Relative change of the carrier between records, with the same trade-off."""
_MOST: Final = 4.0
"""Bound of one record's line, in deviates, so that no single record makes a pair."""
_LOWEST_HZ: Final = 1000.0
"""Lowest centre: below, mains and shaft have many lines."""
_CENTRE: Final = 0.5
"""z of a line at the centre, over that of the sides, from which it is a carrier with a line."""
_CANDIDATES: Final = 3
"""Centres that are examined for each distance."""
_BINS: Final = 2.0
"""Bins by which the centre of one record's lines may be off."""
_WHOLE: Final = 0.02
"""Relative distance from a whole order up to which the distance of the lines is that order."""
_STEADY: Final = 0.6
"""Standard deviation over records of the ln of a line's power up to which it is steady, as that of a supply is. A
larger value accepts more lines by chance."""
SMOOTHED: Final = 0.6
"""Power of a line's highest bin, smoothed over three, over half its squared amplitude: 0.55 to 0.63 between bins."""
_FIRST: Final = 0.6
"""z of a pair, over that of one further out about the same carrier, from which it is the first of two pairs."""


class SidePair(NamedTuple):
    """The pair that stands out most."""

    carrier_hz: float
    order: float
    # Of the weaker line, over the records whose lines are symmetric about the carrier; less where it is unsteady.
    z: float
    part: float  # of the records
    level_log: float  # ln of a line's amplitude, unit of the records: the median over records and both lines
    unsteady: float  # standard deviation over records of the ln of its power
    sharp: float  # median over records of the ln of its power over that of bins beside it

    def exceeds(self, other: SidePair) -> bool:
        """Whether this is the stronger pair, or the pair further out is another one about the same carrier."""
        same = abs(self.carrier_hz / other.carrier_hz - 1) < 2 * _DRIFT and self.order > other.order
        return self.z > (1 / _FIRST if same else 1.0) * other.z


def strongest_pair(records: Sequence[Whitened], logs: Sequence[Single] = ()) -> SidePair | None:
    """The strongest pair of a set of records; None where no centre is possible.

    `logs` are the `log_power` [bins] of each record, where lines have been taken out of it.
    """
    reach_hz = (_ORDERS[-1] + 1) * max(r.shaft_hz for r in records)
    low_hz, top_hz = max(_LOWEST_HZ, reach_hz), min(r.fs_hz for r in records) / 2 - reach_hz
    step_hz = max(max(r.df_hz for r in records), _DRIFT * low_hz)
    centres = np.arange(low_hz, top_hz, step_hz)
    if centres.size < 100:
        return None
    middle, _ = _over_records(records, logs, 0.0, centres, (0,))
    best: SidePair | None = None
    for order in _ORDERS:
        weaker, sides = _over_records(records, logs, float(order), centres, (-1, 1))
        weaker[middle > _CENTRE * weaker] = -np.inf
        for _ in range(_CANDIDATES):
            place = int(np.argmax(weaker))
            if not np.isfinite(weaker[place]):
                break
            found = _examined(sides, float(centres[place]), float(order))
            best = found if best is None or found.exceeds(best) else best
            near = int(np.ceil(max(side.half * side.record.df_hz for side in sides) / step_hz)) + 1
            weaker[max(place - near, 0) : place + near + 1] = -np.inf
    return best


def log_power(record: Whitened) -> Single:
    """[bins] ln of a record's power over its floor, at least 0."""
    return np.maximum(record.logs.astype(np.float32), np.float32(0))


class _Sides:
    """Power of one record where it may have the lines of a pair at a distance of `order` shaft orders.

    Its heights at all bins are kept until `forget`: those of many long records together would fill the memory.
    """

    def __init__(self, record: Whitened, logs: Single | None, order: float) -> None:
        self.record, self._given = record, logs
        self.off_hz = order * record.shaft_hz
        self.half = 1 + round((_SLACK * self.off_hz + _DRIFT * record.fs_hz / 8) / record.df_hz)
        highest = maximum_filter1d(self._logs(), 2 * self.half + 1).astype(float)
        self.middle = float(medians(highest))
        self.spread = max(1.4826 * float(medians(np.abs(highest - self.middle))), 0.1)
        self._highest = highest

    def at(self, centres: Array, sign: int) -> Array:
        """[centres] Height of the line on one side."""
        return np.minimum((self._highest[self._bins(centres, sign)] - self.middle) / self.spread, _MOST)

    def line(self, centre_hz: float, sign: int) -> tuple[float, float]:
        """Frequency, Hz, and height of the highest bin on one side."""
        (at,) = self._bins(np.array([centre_hz]), sign)
        low = max(int(at) - self.half, 0)
        near = self._logs(slice(low, int(at) + self.half + 1))
        place = low + int(np.argmax(near))
        return place * self.record.df_hz, min((float(near.max()) - self.middle) / self.spread, _MOST)

    def forget(self) -> None:
        """Give back the memory of all bins: `line` does without them."""
        self._highest = np.empty(0)

    def _logs(self, bins: slice = slice(None)) -> Single:
        """Log power of some bins."""
        if self._given is not None:
            return self._given[bins]
        return np.maximum(self.record.logs[bins].astype(np.float32), np.float32(0))

    def _bins(self, centres: Array, sign: int) -> NDArray[np.int64]:
        """[centres] Bins of the line on one side, 0 for the centre itself."""
        bins: NDArray[np.int64] = np.rint((centres + sign * self.off_hz) / self.record.df_hz).astype(np.int64)
        return np.clip(bins, 0, self.record.logs.size - 1)


def _over_records(
    records: Sequence[Whitened], logs: Sequence[Single], order: float, centres: Array, signs: Sequence[int]
) -> tuple[Array, list[_Sides]]:
    """[centres] z of the weaker of the lines on these sides in all records, and the sides of each record."""
    totals, sides = np.zeros((len(signs), centres.size)), []
    for place, record in enumerate(records):
        side = _Sides(record, logs[place] if logs else None, order)
        totals += [side.at(centres, sign) for sign in signs]
        side.forget()
        sides.append(side)
    return np.asarray(totals.min(axis=0) / np.sqrt(len(records))), sides


def _examined(sides: Sequence[_Sides], centre_hz: float, order: float) -> SidePair:
    """The pair near a centre, by the records whose lines are symmetric about one carrier."""
    low, high = (np.array([side.line(centre_hz, sign) for side in sides]) for sign in (-1, 1))
    centres, weaker = 0.5 * (low[:, 0] + high[:, 0]), np.minimum(low[:, 1], high[:, 1])
    off = np.array([_BINS * side.record.df_hz for side in sides]) + _DRIFT * centre_hz
    same = np.abs(centres[:, None] - centres) < off[:, None]
    likely = same[:, int(np.argmax((same * np.maximum(weaker, 0)[:, None]).sum(axis=0)))]
    carrier_hz = float(np.median(centres[likely]))
    kept = np.abs(centres - carrier_hz) < off
    # Two lines of different pairs have a centre that moves a little with speed.
    trust = np.clip(1 - 0.5 * np.square((centres - carrier_hz) / off), 0, None)
    found = float(np.median((0.5 * order * (high[:, 0] - low[:, 0]) / [side.off_hz for side in sides])[kept]))
    both = np.stack([low[:, 0], high[:, 0]], axis=1)
    places = [side.record.bins_of(pair) for side, pair in zip(sides, both, strict=True)]
    powers = np.array([side.record.level_logs(at).mean() for side, at in zip(sides, places, strict=True)])
    sharp = np.array([side.record.sharpness(at).mean() for side, at in zip(sides, places, strict=True)])
    z = float(np.where(kept, trust * weaker, 0.0).sum() / np.sqrt(len(sides)))
    unsteady = float(np.std(powers[kept]))
    z /= 1 + max(unsteady - _STEADY, 0.0)
    return SidePair(
        carrier_hz, order if abs(found / order - 1) < _WHOLE else found, z, float(kept.mean()),
        0.5 * (float(np.median(powers[kept])) + math.log(2 / SMOOTHED)), unsteady,
        float(np.median(sharp[kept])),
    )  # fmt: skip


def line_at(
    records: Sequence[Whitened], logs: Sequence[Single], carrier_hz: float, order: float
) -> tuple[float, Array]:
    """z of a line at `order` shaft orders from a carrier, negative below it, and its frequency [records] in each."""
    sides = [_Sides(record, own, abs(order)) for record, own in zip(records, logs, strict=True)]
    lines = np.array([side.line(carrier_hz, 1 if order > 0 else -1) for side in sides])
    return float(lines[:, 1].sum() / np.sqrt(len(sides))), lines[:, 0]
