"""Lines in spectra averaged over a set of records: combs, pairs and single lines that are too faint in a single record.

Whitened of each record --mean in Hz and in orders--> z on combs of mains, shaft, another bearing --> lines
                        --record by record, at the speed where a comb stands highest--> gear mesh, race waviness
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from twingap.bearing import Bearing
from twingap.gap.features.tones import carrier, gear_mesh, race_waviness
from twingap.gap.features.tones.whitened_spectra import MOST_Z, Mean, Whitened, combined_z, max_z

NAMES: Final = (
    "mains_50_1", "mains_50_max", "mains_50_all", "mains_60_1", "mains_60_max", "mains_60_all",
    "order_1", "order_2", "order_3", "order_few", "order_high",
    "half_1", "half_max", "half_all", *race_waviness.NAMES, *gear_mesh.NAMES, *carrier.NAMES,
    "turning", "turning_order",
    "envelope_1x", "envelope_2x", "envelope_cage", "foreign", "foreign_order", "modulation_fixed", "modulation_hz",
)  # fmt: skip
_MOST_BY_ONE: Final = 300
"""Largest number of records that are searched one by one. More find fainter gears and waviness, and take longer."""


def measure(records: Sequence[Whitened], bearing: Bearing) -> dict[str, float]:
    """`NAMES` -> value of a set of records; NaN without records. Lines as compressed z, places as logarithms."""
    out = dict.fromkeys(NAMES, math.nan)
    if not records:
        return out
    healthy = [r for r in records if r.kind == "healthy"] or list(records)
    hz, turns = Mean.in_hz(records), Mean.in_orders(records)
    for mains in (50, 60):
        z = hz.at(mains * np.arange(1.0, 7.0))
        out[f"mains_{mains}_1"], out[f"mains_{mains}_max"] = z[0], max_z(z)
        out[f"mains_{mains}_all"] = combined_z(z)
    z = turns.at(np.arange(1.0, 13.0))
    out["order_1"], out["order_2"], out["order_3"] = z[:3]
    out["order_few"], out["order_high"] = combined_z(z[:4]), combined_z(z[4:])
    z = turns.at(np.arange(0.5, 6.5))
    out["half_1"], out["half_max"], out["half_all"] = z[0], max_z(z), combined_z(z)
    few = [records[k] for k in np.linspace(0, len(records) - 1, min(len(records), _MOST_BY_ONE)).round().astype(int)]
    deviates = [record.deviates() for record in few]
    out |= race_waviness.measure(few, deviates, bearing) | gear_mesh.measure(few, deviates)
    out |= carrier.measure(hz, few, deviates)
    _turning(turns, bearing, out)
    envelope = Mean.in_orders(healthy, envelope=True)
    out["envelope_1x"], out["envelope_2x"], out["envelope_cage"] = envelope.at(np.array([1.0, 2.0, bearing.ftf]))
    _foreign(envelope, bearing, out)
    _modulation(Mean.in_hz(healthy, envelope=True), out)
    places = {name for name in NAMES if name.endswith(("_fs", "_order", "_teeth", "_hz", "pair_part", "pair_level"))}
    return {name: v if name in places else _compressed(v) for name, v in out.items()}


def _compressed(z: float) -> float:
    return math.copysign(math.log1p(abs(z)), z) if math.isfinite(z) else math.nan


def _turning(turns: Mean, bearing: Bearing, out: dict[str, float]) -> None:
    """Fill the strongest line at an order that is neither an integer, a half order, nor this bearing's."""
    places, z = turns.places, turns.common.copy()
    z[places > 40.0] = np.nan
    for comb in (0.5, bearing.bpfo, bearing.bpfi, 2 * bearing.bsf):
        multiple = np.maximum(np.rint(places / comb), 1)
        z[np.abs(places - multiple * comb) < 0.04 + 0.035 * (comb > 0.5) * multiple * comb] = np.nan
    if np.isfinite(z).any():
        place = int(np.nanargmax(z))
        out["turning"], out["turning_order"] = float(z[place]), math.log(places[place])


def _foreign(envelope: Mean, bearing: Bearing, out: dict[str, float]) -> None:
    """Fill the best comb of the envelope at an order that is neither this bearing's nor the shaft's."""
    places = np.arange(1.1, 14.0, 0.004)
    z = np.clip(envelope.at(places[:, None] * np.arange(1, 4)), -MOST_Z, 4 * MOST_Z)
    # With equal weights, a comb of every third line would score equally.
    weight = 1 / np.arange(1.0, 4.0)
    score = np.nan_to_num(z) @ weight / math.sqrt(weight @ weight)
    score[np.isnan(z[:, 0])] = np.nan
    for own in (1.0, bearing.bpfo, bearing.bpfi, 2 * bearing.bsf):
        multiple = np.maximum(np.rint(places / own), 1)
        score[np.abs(places / (multiple * own) - 1) < (0.008 if own == 1.0 else 0.04)] = np.nan
    if np.isfinite(score).any():
        best = float(np.nanmax(score))
        near = score >= 0.9 * best if best > 0 else score == best
        place = int(np.argmax(near))  # combs at multiples of the true rate score equally: the lowest is the true one
        place += int(np.nanargmax(score[place : place + 4]))
        out["foreign"], out["foreign_order"] = best, math.log(places[place])


def _modulation(envelope: Mean, out: dict[str, float]) -> None:
    """Fill the strongest envelope line that is fixed in Hz: a modulation independent of rotation."""
    z = np.where(envelope.places < 120.0, envelope.z, np.nan)
    if np.isfinite(z).any():
        place = int(np.nanargmax(z))
        out["modulation_fixed"], out["modulation_hz"] = float(z[place]), math.log(envelope.places[place])
