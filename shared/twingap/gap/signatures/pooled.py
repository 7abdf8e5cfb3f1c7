"""Lines that no single record shows: whitened spectra of a set, averaged in Hz and in shaft orders.

records --periodogram over its floor--> whitened spectra --mean over records, in Hz and in orders--> z of every place
                                                                          z on combs, pairs, carriers --> lines

A line far below the noise of one record stands in the mean of many, where the noise is even. What is fixed in Hz
(mains, a carrier) adds up in Hz, what turns with the shaft in orders, and each smears in the other's mean. Power of
noise goes as gamma variates, whose cube root is all but normal (Wilson and Hilferty 1931, doi:10.1073/pnas.17.12.684):
so z means the same of one record and of a hundred, and z of several lines may be added (Stouffer).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.gap.signatures.answer import impact_rate_hz
from twingap.gap.view import RecordView, local_floor, medians

Array = NDArray[np.float64]
Single = NDArray[np.float32]

NAMES: Final = (
    "mains_50_1", "mains_50_most", "mains_50_all", "mains_60_1", "mains_60_most", "mains_60_all",
    "order_1", "order_2", "order_3", "order_few", "order_high",
    "half_1", "half_most", "half_all", "wave_outer", "wave_inner", "gear", "gear_sides", "gear_teeth",
    "fixed", "fixed_fs", "fixed_sides", "fixed_side_order",
    "carrier", "carrier_fs", "carrier_sides", "carrier_side_order", "turning", "turning_order",
    "envelope_1x", "envelope_2x", "envelope_cage", "foreign", "foreign_order", "modulation_fixed", "modulation_hz",
)  # fmt: skip
_CAP: Final = 9.0
"""Excess beyond which one record's line counts no more: the mean is of many records, not of the loudest."""
_ENVELOPE_CAP: Final = 40.0
"""The same of envelopes, whose combs are told by how their lines fall off."""
_MOST_Z: Final = 12.0
"""Beyond which a line adds no more to the z of its comb: one line is no comb."""
_NOISE: Final = 1 / math.log(2)
"""Mean power of noise over its median."""
_SPREAD: Final = 0.258
"""Standard deviation of the cube root of smoothed noise power over its median, of one record (Hann, 1/4 1/2 1/4)."""
_ABOUT: Final = 45
"""Bins about a line that say how much is usual there."""
_TOP_ORDER: Final = 125.0
_STEP: Final = 0.01
"""Of the order axis, unless a record resolves more: one of a second at ten turns resolves a tenth."""
_MAINS_TO_HZ: Final = 1300.0
"""Up to where a line on a multiple of 50 or 60 Hz is taken for the mains': beyond, one place in seven is on one."""
_MAINS_SHOWN: Final = 3.5
"""z of other multiples of the mains from which a line on one of them is theirs; its first few always are."""
_FIRST_FEW: Final = 230.0
_LOWEST: Final = 0.06
"""Of half the sampling rate, below which no carrier is sought: there the mains has its skirts."""
_HARMONICS: Final = 8
_TURNING: Final = 0.6
"""Part of the records in which a whole order lies at a place, from which a line there is the shaft's."""
_NEAR: Final = np.arange(4, 10)
"""Bins from a line at which nothing of it is left, and all of a mode."""
_OFFSETS: Final = np.concatenate((np.zeros(1, int), np.arange(-22, -6), np.arange(7, 23)))
"""Bins: a line, and those about it that say how much is usual there."""
_CARRIERS: Final = 12
"""Lines fixed in Hz that are asked for lines beside them."""


class Whitened(NamedTuple):
    """What is kept of a record for means over many.

    Parameters
    ----------
    power : Single [bins]
        Periodogram over its floor, smoothed over three bins, capped.
    df_hz : float
    envelope : Single [bins]
        The same of the broadband squared envelope.
    envelope_df_hz : float
    shaft_hz, fs_hz : float
    kind : str
        State of the bearing: what strikes leave is in the records of one kind alone.
    """

    power: Single
    df_hz: float
    envelope: Single
    envelope_df_hz: float
    shaft_hz: float
    fs_hz: float
    kind: str


def whitened(view: RecordView) -> Whitened:
    """Of one record."""
    envelope = view.envelope_in(0.02 * view.fs_hz, 0.48 * view.fs_hz)
    top = min(envelope.spectrum.size, round(45 * view.shaft_hz / envelope.df_hz) + 60)
    power = _white(view.tones, _CAP)
    if view.fault_order is not None:
        # A defect's own comb is no line of interest: its places count as nothing special. Cages slip.
        rate_hz = impact_rate_hz(view)
        at = np.arange(1, int(0.5 * view.fs_hz / rate_hz) + 1) * rate_hz / view.df_hz
        for place, reach in zip(at, 3 + 0.004 * at, strict=True):
            power[max(int(place - reach), 0) : int(place + reach) + 2] = _NOISE
    return Whitened(
        power, view.df_hz, _white(envelope.spectrum[:top], _ENVELOPE_CAP), envelope.df_hz, view.shaft_hz, view.fs_hz,
        str(view.condition.fault),
    )  # fmt: skip


def _white(power: Array, cap: float) -> Single:
    over = power / np.maximum(local_floor(power), 1e-300)
    over[:3] = _NOISE
    smooth = over.copy()
    # A line between two bins stands in both; a speed that is a little off moves it by one.
    smooth[1:-1] = 0.5 * over[1:-1] + 0.25 * (over[:-2] + over[2:])
    return np.asarray(np.minimum(smooth, cap), dtype=np.float32)


def measure(records: Sequence[Whitened], bearing: Bearing) -> dict[str, float]:
    """`NAMES` -> value for a set of records; NaN without records. Lines as z, compressed, places as logarithms."""
    out = dict.fromkeys(NAMES, math.nan)
    if not records:
        return out
    healthy = [r for r in records if r.kind == "healthy"] or list(records)
    hz, turns = Mean.in_hz(records), Mean.in_orders(records)
    for mains in (50, 60):
        z = hz.at(mains * np.arange(1.0, 7.0))
        out[f"mains_{mains}_1"], out[f"mains_{mains}_most"] = z[0], _most(z)
        out[f"mains_{mains}_all"] = _together(z)
    z = turns.at(np.arange(1.0, 13.0))
    out["order_1"], out["order_2"], out["order_3"] = z[:3]
    out["order_few"], out["order_high"] = _together(z[:4]), _together(z[4:])
    z = turns.at(np.arange(0.5, 6.5))
    out["half_1"], out["half_most"], out["half_all"] = z[0], _most(z), _together(z)
    for name, order in (("outer", bearing.bpfo), ("inner", bearing.bpfi)):
        ratios = np.linspace(0.965, 1.035, 57)
        out[f"wave_{name}"] = _most(_together(turns.at(order * ratios[:, None] * np.arange(1, 5))))
    _gear(turns, out)
    _fixed(hz, records, out)
    _turning(turns, bearing, out)
    envelope = Mean.in_orders(healthy, envelope=True)
    out["envelope_1x"], out["envelope_2x"], out["envelope_cage"] = envelope.at(np.array([1.0, 2.0, bearing.ftf]))
    _foreign(envelope, bearing, out)
    _modulation(Mean.in_hz(healthy, envelope=True), out)
    places = {name for name in NAMES if name.endswith(("_fs", "_order", "_teeth", "_hz"))}
    return {name: v if name in places else _compressed(v) for name, v in out.items()}


class Mean:
    """Mean of whitened spectra on an axis that all share, and how far each place of it stands out.

    Parameters
    ----------
    powers : sequence of Single [bins]
        One of each record.
    places : Array [places]
        The axis, evenly spaced.
    indices : sequence of NDArray [places]
        Bin of each place in each record.
    about : int
        Places about each that say how much is usual there.
    kinds : sequence of str
        State of the bearing of each record.

    Attributes
    ----------
    places : Array [places]
        Hz, or orders.
    z : Array [places]
        Normal deviates where there is nothing but noise; NaN beyond what most of the records reach.
    common : Array [places]
        Above what is usual on either side of a line, where a sharp mode is no less high; and the least that is left
        when the records of any one kind are left out: what is a machine's own is there whatever the state of its
        bearing, and what strikes leave beside their harmonics is not.
    """

    def __init__(
        self,
        powers: Sequence[Single],
        places: Array,
        indices: Sequence[NDArray[np.int64]],
        about: int,
        kinds: Sequence[str],
    ) -> None:
        self.places, self.step = places, float(places[1] - places[0]) if places.size > 1 else 1.0
        names = sorted(set(kinds))
        totals, counts = np.zeros((2, len(names), places.size))
        for power, index, kind in zip(powers, indices, kinds, strict=True):
            inside = (index >= 2) & (index < power.size - 2)
            totals[names.index(kind), inside] += power[index[inside]]
            counts[names.index(kind)] += inside
        total, count = totals.sum(axis=0), counts.sum(axis=0)
        self.z = np.full(places.size, np.nan)
        self.common = self.z
        known = count > 0.6 * len(powers)
        if known.sum() <= about:
            return
        floor = np.maximum(local_floor(total[known] / count[known], about), 1e-9)

        def deviates(total: Array, count: Array) -> Array:
            return (np.cbrt(total / np.maximum(count, 1) / floor) - 1) * np.sqrt(count) / _SPREAD

        z = deviates(total[known], count[known])
        # Noise that comes and goes is less even than that.
        spread = max(1.4826 * float(medians(np.abs(z))), 1.0)
        self.z[known] = z / spread
        floor = np.maximum(floor, _beside_each(total[known] / count[known], _NEAR * max(about // _ABOUT, 1)))
        left = [deviates(t, c) for t, c in zip((total - totals)[:, known], (count - counts)[:, known], strict=True)]
        common = np.min([*(left if len(names) > 1 else []), deviates(total[known], count[known])], axis=0)
        self.common = np.full(places.size, np.nan)
        self.common[known] = common / spread

    @classmethod
    def in_hz(cls, records: Sequence[Whitened], envelope: bool = False) -> Mean:
        """Of what is fixed in Hz."""
        powers, resolutions = _spectra(records, envelope)
        # As fine as the longest record: a coarser one is read more than once, but no line falls between two places.
        step = min(resolutions)
        top = max(power.size * df for power, df in zip(powers, resolutions, strict=True))
        places = np.arange(2.0, top / step) * step
        indices = [np.rint(places / df).astype(int) for df in resolutions]
        return cls(powers, places, indices, int(_ABOUT * max(resolutions) / step) | 1, [r.kind for r in records])

    @classmethod
    def in_orders(cls, records: Sequence[Whitened], envelope: bool = False) -> Mean:
        """Of what turns with the shaft."""
        powers, resolutions = _spectra(records, envelope)
        units = [r.shaft_hz / df for r, df in zip(records, resolutions, strict=True)]
        step = min(_STEP, 1 / max(units))
        places = np.arange(0.3, 45.0 if envelope else _TOP_ORDER, step)
        indices = [np.rint(places * unit).astype(int) for unit in units]
        return cls(powers, places, indices, int(_ABOUT / min(units) / step) | 1, [r.kind for r in records])

    def at(self, places: Array) -> Array:
        """z at the nearest places of the axis; NaN off it."""
        index = np.rint((places - self.places[0]) / self.step).astype(int) if self.places.size else np.zeros(0, int)
        inside = (index >= 0) & (index < self.places.size)
        return np.where(inside, self.z[np.clip(index, 0, self.places.size - 1)], np.nan)


def _beside_each(mean: Array, offsets: NDArray[np.int64]) -> Array:
    """[places] What is usual just below each place or just above it, whichever is more."""
    reach = int(offsets.max())
    padded = np.pad(mean, reach, mode="edge")
    sides = [
        medians(np.stack([padded[reach + sign * k : reach + sign * k + mean.size] for k in offsets], axis=-1))
        for sign in (-1, 1)
    ]
    return np.maximum(*sides)


def _spectra(records: Sequence[Whitened], envelope: bool) -> tuple[list[Single], list[float]]:
    """Of each record its spectrum, or that of its envelope, and Hz per bin."""
    if envelope:
        return [r.envelope for r in records], [r.envelope_df_hz for r in records]
    return [r.power for r in records], [r.df_hz for r in records]


def _compressed(z: float) -> float:
    return math.copysign(math.log1p(abs(z)), z) if math.isfinite(z) else math.nan


def _together(z: Array) -> Any:
    """z of lines [..., lines] together, what is not known left out; a strong one counts as `_MOST_Z`."""
    known = np.isfinite(z)
    total = np.where(known, np.clip(z, -_MOST_Z, _MOST_Z), 0.0).sum(axis=-1)
    return np.where(known.any(axis=-1), total / np.sqrt(np.maximum(known.sum(axis=-1), 1)), np.nan)


def _most(z: Array) -> float:
    known = z[np.isfinite(z)]
    return float(known.max()) if known.size else math.nan


def _gear(turns: Mean, out: dict[str, float]) -> None:
    """The whole order that stands out most with side lines one order away and its double, at about this speed."""
    teeth = np.arange(6.0, 100.0)
    shifts = 1 + np.linspace(-0.003, 0.003, 13)
    z = turns.at(shifts[:, None, None] * (teeth[:, None] + np.array([0.0, -1.0, 1.0])))
    double = turns.at(shifts[:, None] * 2 * teeth)
    side = _together(z[..., 1:])
    score = z[..., 0] + 0.5 * np.maximum(np.nan_to_num(side), 0) + 0.5 * np.maximum(np.nan_to_num(double), 0)
    if not np.isfinite(score).any():
        return
    place = np.unravel_index(int(np.nanargmax(score)), score.shape)
    out["gear"], out["gear_sides"] = float(z[place][0]), float(side[place])
    out["gear_teeth"] = math.log(teeth[place[1]])


def _fixed(hz: Mean, records: Sequence[Whitened], out: dict[str, float]) -> None:
    """The strongest line fixed in Hz that is no mains; and the one that is, with lines beside it that turn."""
    top = 0.5 * min(r.fs_hz for r in records)
    z = np.where((hz.places > max(65.0, _LOWEST * top)) & (hz.places < top), hz.common, np.nan)
    for mains in (50.0, 60.0):
        shown = _together(hz.at(mains * np.arange(1.0, _HARMONICS + 1))) > _MAINS_SHOWN
        off = np.abs(hz.places / mains - np.rint(hz.places / mains)) * mains
        z[(off < 2.5 * hz.step) & (hz.places < (_MAINS_TO_HZ if shown else _FIRST_FEW))] = np.nan
    # Of records at one speed, what turns with the shaft is fixed in Hz as well.
    speeds, times = np.unique(np.round([r.shaft_hz for r in records], 2), return_counts=True)
    turning = np.zeros(hz.places.size)
    for shaft_hz, count in zip(speeds, times, strict=True):
        turning += count * (np.abs(hz.places / shaft_hz - np.rint(hz.places / shaft_hz)) * shaft_hz < 2.5 * hz.step)
    z[turning > _TURNING * len(records)] = np.nan
    if not np.isfinite(z).any():
        return
    known = np.nan_to_num(z, nan=-9.0)
    peaks = np.flatnonzero((known[1:-1] >= known[:-2]) & (known[1:-1] > known[2:])) + 1
    strongest = peaks[np.argsort(known[peaks])[::-1][:_CARRIERS]]
    if not strongest.size:
        return
    carriers, orders = hz.places[strongest], np.arange(1, 9)
    sides = _beside(records, carriers, orders)
    own = known[strongest]
    out["fixed"], out["fixed_fs"] = float(own[0]), math.log(carriers[0] / (2 * top))
    if not np.isfinite(sides).any():
        return
    sides = np.nan_to_num(sides, nan=-9.0)
    out["fixed_sides"], out["fixed_side_order"] = float(sides[0].max()), float(orders[int(np.argmax(sides[0]))])
    joint = np.hypot(np.minimum(own, 2 * _MOST_Z)[:, None], np.maximum(sides, 0.0))
    carrier, order = np.unravel_index(int(np.argmax(joint)), joint.shape)
    out["carrier"], out["carrier_fs"] = float(joint[carrier, order]), math.log(carriers[carrier] / (2 * top))
    out["carrier_sides"], out["carrier_side_order"] = float(sides[carrier, order]), float(orders[order])


def _beside(records: Sequence[Whitened], carriers: Array, orders: NDArray[np.int64]) -> Array:
    """[carriers, orders] z of the lines so many shaft orders above and below each carrier, together."""
    total, count = np.zeros((_OFFSETS.size, carriers.size, orders.size)), np.zeros((carriers.size, orders.size))
    for r in records:
        for sign in (-1, 1):
            index = np.rint((carriers[:, None] + sign * orders * r.shaft_hz) / r.df_hz).astype(int)
            inside = (index > 30) & (index < r.power.size - 30)
            reached = np.clip(index + _OFFSETS[:, None, None], 0, r.power.size - 1)
            total += np.where(inside, r.power[reached], 0.0)
            count += inside
    usual = medians(np.moveaxis(total[1:], 0, -1))
    root = np.cbrt(total[0] / np.maximum(usual, 1e-9))
    return np.where(count > 0, (root - 1) * np.sqrt(np.maximum(count, 1)) / _SPREAD, np.nan)


def _turning(turns: Mean, bearing: Bearing, out: dict[str, float]) -> None:
    """The strongest line that turns with the shaft at an order that is neither whole, half, nor this bearing's."""
    places, z = turns.places, turns.common.copy()
    z[places > 40.0] = np.nan
    for comb in (0.5, bearing.bpfo, bearing.bpfi, 2 * bearing.bsf):
        multiple = np.maximum(np.rint(places / comb), 1)
        z[np.abs(places - multiple * comb) < 0.04 + 0.035 * (comb > 0.5) * multiple * comb] = np.nan
    if np.isfinite(z).any():
        place = int(np.nanargmax(z))
        out["turning"], out["turning_order"] = float(z[place]), math.log(places[place])


def _foreign(envelope: Mean, bearing: Bearing, out: dict[str, float]) -> None:
    """The comb of the envelope at an order that is not this bearing's nor the shaft's."""
    places = np.arange(1.1, 14.0, 0.004)
    z = np.clip(envelope.at(places[:, None] * np.arange(1, 4)), -_MOST_Z, 4 * _MOST_Z)
    # The first line of a comb is the strongest: else its third would be the first of as good a comb.
    weight = 1 / np.arange(1.0, 4.0)
    score = np.nan_to_num(z) @ weight / math.sqrt(weight @ weight)
    score[np.isnan(z[:, 0])] = np.nan
    for own in (1.0, bearing.bpfo, bearing.bpfi, 2 * bearing.bsf):
        multiple = np.maximum(np.rint(places / own), 1)
        score[np.abs(places / (multiple * own) - 1) < (0.008 if own == 1.0 else 0.04)] = np.nan
    if np.isfinite(score).any():
        best = float(np.nanmax(score))
        near = score >= 0.9 * best if best > 0 else score == best
        place = int(np.argmax(near))  # of combs as good, the multiples of one, it is the one
        place += int(np.nanargmax(score[place : place + 4]))
        out["foreign"], out["foreign_order"] = best, math.log(places[place])


def _modulation(envelope: Mean, out: dict[str, float]) -> None:
    """The strongest line of the envelope that is fixed in Hz: a modulation that turns with nothing."""
    z = np.where(envelope.places < 120.0, envelope.z, np.nan)
    if np.isfinite(z).any():
        place = int(np.nanargmax(z))
        out["modulation_fixed"], out["modulation_hz"] = float(z[place]), math.log(envelope.places[place])
