"""Lines that no single record shows: whitened spectra of a set, averaged in Hz and in shaft orders.

records --periodogram over its floor--> whitened spectra --mean over records, in Hz and in orders--> z of a line

A line far below the noise of one record stands in the mean of many, where the noise is even. What is fixed in Hz
(mains, a carrier) adds up in Hz, what turns with the shaft in orders, and each smears in the other's mean. z is taken
against the same mean a few bins away, so that neither length nor number of records matters to what nothing looks like.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.gap.view import RecordView, known_medians, local_floor, medians

Array = NDArray[np.float64]
Single = NDArray[np.float32]

NAMES: Final = (
    "mains_50_1", "mains_50_mean", "mains_60_1", "mains_60_mean", "order_1", "order_2", "order_3", "order_high",
    "half_1", "half_mean", "wave_outer", "wave_inner", "gear", "gear_sides", "gear_teeth",
    "fixed", "fixed_fs", "fixed_sides", "fixed_side_order", "turning", "turning_order",
    "envelope_1x", "envelope_2x", "envelope_cage", "foreign", "foreign_order", "modulation_fixed", "modulation_hz",
)  # fmt: skip
USUAL: Final = 2.6
"""Mean of the largest of three bins of a periodogram over its median floor, where nothing stands out."""
_CAP: Final = 40.0
"""Excess beyond which one record's line counts no more: the mean is of records, not of the loudest."""
_CONTROLS: Final = np.concatenate((np.arange(-22, -6), np.arange(7, 23)))
_TOP_ORDER: Final = 100.0
_STEP: Final = 0.01
"""Of the order axis; records of one second at ten turns resolve a tenth."""


class Whitened(NamedTuple):
    """What is kept of a record for means over many.

    Parameters
    ----------
    power : Single [bins]
        Periodogram over its floor, the largest of three bins, capped.
    df_hz : float
    envelope : Single [bins]
        The same of the broadband squared envelope.
    envelope_df_hz : float
    shaft_hz, fs_hz : float
    healthy : bool
    """

    power: Single
    df_hz: float
    envelope: Single
    envelope_df_hz: float
    shaft_hz: float
    fs_hz: float
    healthy: bool


def whitened(view: RecordView) -> Whitened:
    """Of one record."""
    envelope = view.envelope_in(0.02 * view.fs_hz, 0.48 * view.fs_hz)
    top = min(envelope.spectrum.size, round(45 * view.shaft_hz / envelope.df_hz) + 60)
    power = _white(view.tones)
    if view.fault_order is not None:
        # A defect's own comb is no line of interest: its places count as nothing special.
        comb = np.arange(1, int(0.5 * view.fs_hz / (view.fault_order * view.shaft_hz)) + 1)
        at = comb * view.fault_order * view.shaft_hz / view.df_hz
        for place, reach in zip(at, 3 + 0.004 * at, strict=True):
            power[max(int(place - reach), 0) : int(place + reach) + 2] = USUAL
    return Whitened(
        power, view.df_hz, _white(envelope.spectrum[:top]), envelope.df_hz, view.shaft_hz, view.fs_hz,
        view.condition.fault == "healthy",
    )  # fmt: skip


def _white(power: Array) -> Single:
    over = power / np.maximum(local_floor(power), 1e-300)
    over[:3] = 1.0
    widest = np.maximum(over, 1.0)
    widest[1:-1] = np.maximum(np.maximum(over[1:-1], over[:-2]), over[2:])
    widest[0], widest[-1] = max(widest[0], *over[1:2]), max(widest[-1], *over[-2:-1])
    return np.asarray(np.minimum(widest, _CAP), dtype=np.float32)


def measure(records: Sequence[Whitened], bearing: Bearing) -> dict[str, float]:
    """`NAMES` -> value for a set of records; NaN without records. Lines as z, places as logarithms."""
    out = dict.fromkeys(NAMES, math.nan)
    if not records:
        return out
    healthy = [r for r in records if r.healthy] or list(records)
    hz, turns = _Pool(records, False), _Pool(records, True)
    k = np.arange(1.0, 7.0)
    for mains in (50, 60):
        z = hz.z(mains * k)
        out[f"mains_{mains}_1"], out[f"mains_{mains}_mean"] = z[0], _mean(z[:5])
    z = turns.z(np.arange(1.0, 13.0))
    out["order_1"], out["order_2"], out["order_3"], out["order_high"] = z[0], z[1], z[2], _mean(z[3:])
    z = turns.z(np.arange(0.5, 6.5))
    out["half_1"], out["half_mean"] = z[0], _mean(z)
    quiet = _Pool(healthy, True)
    for name, order in (("outer", bearing.bpfo), ("inner", bearing.bpfi)):
        ratios = np.linspace(0.965, 1.035, 29)
        z = quiet.z((order * ratios[:, None] * np.arange(1, 5)).ravel()).reshape(29, 4)
        out[f"wave_{name}"] = float(np.nanmax(np.nan_to_num(np.nanmean(z, axis=1) if np.isfinite(z).any() else z)))
    _gear(turns, out)
    _fixed(hz, records, out)
    _turning(turns, bearing, out)
    envelope = _Pool(healthy, True, envelope=True)
    z = envelope.z(np.array([1.0, 2.0, bearing.ftf]))
    out["envelope_1x"], out["envelope_2x"], out["envelope_cage"] = z
    _foreign(envelope, bearing, out)
    _modulation(_Pool(healthy, False, envelope=True), out)
    return {name: (float(v) if math.isfinite(v) else math.nan) for name, v in out.items()}


class _Pool:
    """Whitened spectra of records, read at places that are the same in Hz, or in turns of each one's shaft."""

    def __init__(self, records: Sequence[Whitened], orders: bool, envelope: bool = False) -> None:
        self.rows = [(r.envelope, r.envelope_df_hz) if envelope else (r.power, r.df_hz) for r in records]
        self.unit = [r.shaft_hz if orders else 1.0 for r in records]

    def at(self, places: Array) -> Array:
        """[places] Mean over the records that reach them."""
        return np.asarray(self.beside(places, np.zeros(1, int))[0])

    def beside(self, places: Array, offsets: NDArray[np.int64]) -> Array:
        """[offsets, places] The same so many bins away."""
        total, count = np.zeros((2, offsets.size, places.size))
        for (power, df), unit in zip(self.rows, self.unit, strict=True):
            index = np.rint(places * (unit / df)).astype(int) + offsets[:, None]
            inside = (index >= 2) & (index < power.size - 2)
            total += np.where(inside, power[np.clip(index, 0, power.size - 1)], 0.0)
            count += inside
        return np.where(count > 0.6 * len(self.rows), total / np.maximum(count, 1), np.nan)

    def z(self, places: Array) -> Array:
        """[places] How far the mean stands out of itself a few bins away, log-compressed, signed."""
        around = self.beside(places, _CONTROLS)
        # Below a low line there is no room: then its upper neighbours stand for all.
        known = np.isfinite(around).sum(axis=0) >= _CONTROLS.size // 2
        usual, spread = np.ones(places.size), np.ones(places.size)
        usual[known] = known_medians(around[:, known])
        spread[known] = np.maximum(1.4826 * known_medians(np.abs(around[:, known] - usual[known])), 0.02)
        z = (self.at(places) - usual) / spread
        return np.where(known, np.sign(z) * np.log1p(np.abs(z)), np.nan)

    def curve(self, places: Array) -> Array:
        """[places] z of every place of a fine grid, against the grid about it."""
        mean = self.at(places)
        known = np.isfinite(mean)
        if known.sum() < 200:
            return np.full(places.size, np.nan)
        floor = local_floor(np.where(known, mean, medians(mean[known])), 201)
        spread = max(1.4826 * float(medians(np.abs(mean[known] - floor[known]))), 0.02)
        return np.where(known, np.log1p(np.maximum((mean - floor) / spread, 0.0)), np.nan)


def _gear(turns: _Pool, out: dict[str, float]) -> None:
    """The whole order that stands out most with a side line one order away on either side."""
    orders = np.arange(6.0, _TOP_ORDER + 1)
    z = turns.z(orders)
    if not np.isfinite(z[1:-1]).any():
        return
    sides = 0.5 * (z[:-2] + z[2:])
    score = np.where(np.isfinite(sides + z[1:-1]), z[1:-1] + 0.5 * sides, -np.inf)
    place = int(np.argmax(score))
    out["gear"], out["gear_sides"] = float(z[1:-1][place]), float(sides[place])
    out["gear_teeth"] = math.log(orders[1:-1][place])


def _fixed(hz: _Pool, records: Sequence[Whitened], out: dict[str, float]) -> None:
    """The strongest line fixed in Hz that is no mains, and lines beside it that turn with the shaft."""
    df = max(df for _, df in hz.rows)
    top = 0.5 * min(r.fs_hz for r in records)
    places = np.arange(65.0, top, df)
    curve = hz.curve(places)
    for mains in (50.0, 60.0):
        curve[np.abs(places / mains - np.rint(places / mains)) * mains < 2.5 * df] = 0.0
    if not np.isfinite(curve).any():
        return
    place = int(np.nanargmax(curve))
    carrier = places[place]
    out["fixed"], out["fixed_fs"] = float(curve[place]), math.log(carrier / (2 * top))
    best, total = 0.0, np.full(8, np.nan)
    for order in range(1, 9):
        values = []
        for (power, own_df), record in zip(hz.rows, records, strict=True):
            for sign in (-1, 1):
                index = round((carrier + sign * order * record.shaft_hz) / own_df)
                if 30 < index < power.size - 30:
                    near = power[index - 22 : index + 23]
                    values.append(float(power[index]) - float(medians(np.asarray(near, float))))
        if values:
            total[order - 1] = np.mean(values) * math.sqrt(len(values))
    if np.isfinite(total).any():
        best = float(np.nanmax(total))
        out["fixed_sides"] = math.log1p(max(best, 0.0))
        out["fixed_side_order"] = float(np.nanargmax(total) + 1)


def _turning(turns: _Pool, bearing: Bearing, out: dict[str, float]) -> None:
    """The strongest line that turns with the shaft at an order that is neither whole, half, nor this bearing's."""
    places = np.arange(0.3, 40.0, _STEP)
    curve = turns.curve(places)
    for comb in (0.5, bearing.bpfo, bearing.bpfi, 2 * bearing.bsf):
        multiple = np.maximum(np.rint(places / comb), 1)
        curve[np.abs(places - multiple * comb) < 0.04 + 0.035 * (comb > 0.5) * multiple * comb] = 0.0
    if np.isfinite(curve).any():
        place = int(np.nanargmax(curve))
        out["turning"], out["turning_order"] = float(curve[place]), math.log(places[place])


def _foreign(envelope: _Pool, bearing: Bearing, out: dict[str, float]) -> None:
    """The comb of the envelope at an order that is not this bearing's nor the shaft's."""
    places = np.arange(1.1, 14.0, 0.004)
    combs = np.stack([envelope.at(places * k) for k in (1, 2, 3)])
    for own in (1.0, bearing.bpfo, bearing.bpfi, 2 * bearing.bsf):
        multiple = np.maximum(np.rint(places / own), 1)
        combs[:, np.abs(places / (multiple * own) - 1) < (0.008 if own == 1.0 else 0.04)] = np.nan
    with np.errstate(invalid="ignore"):
        score = np.where(np.isfinite(combs[0]), np.nan_to_num(combs, nan=1.0).mean(axis=0), np.nan)
    known = np.isfinite(score)
    if known.sum() < 200:
        return
    middle = float(medians(score[known]))
    spread = max(1.4826 * float(medians(np.abs(score[known] - middle))), 0.02)
    place = int(np.nanargmax(score))
    out["foreign"] = math.log1p(max((float(score[place]) - middle) / spread, 0.0))
    out["foreign_order"] = math.log(places[place])


def _modulation(envelope: _Pool, out: dict[str, float]) -> None:
    """The strongest line of the envelope that is fixed in Hz: a modulation that turns with nothing."""
    places = np.arange(2.0, 120.0, max(df for _, df in envelope.rows))
    curve = envelope.curve(places) if places.size > 220 else _short(envelope.at(places))
    if np.isfinite(curve).any():
        place = int(np.nanargmax(curve))
        out["modulation_fixed"], out["modulation_hz"] = float(curve[place]), math.log(places[place])


def _short(mean: Array) -> Array:
    known = np.isfinite(mean)
    if known.sum() < 8:
        return np.full(mean.size, np.nan)
    middle = float(medians(mean[known]))
    spread = max(1.4826 * float(medians(np.abs(mean[known] - middle))), 0.02)
    return np.where(known, np.log1p(np.maximum((mean - middle) / spread, 0.0)), np.nan)


def _mean(z: Array) -> float:
    known = z[np.isfinite(z)]
    return float(known.mean()) if known.size else math.nan
