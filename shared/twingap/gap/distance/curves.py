"""Curves for figures: medians of each domain's bins over records, measured and simulated, with 90 % bands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from twingap.bearing import Bearing
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.domains import DOMAIN, PER_DECIBEL
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.stratification import strata
from twingap.gap.report.model import Curve
from twingap.records import Array, Condition

_FAULT_WORDS: Final[Mapping[str, str]] = {
    "healthy": "healthy", "outer": "outer race fault", "inner": "inner race fault", "ball": "ball fault",
    "cage": "cage fault",
}  # fmt: skip


def curves(
    real: FeatureVectors, before: Sequence[FeatureVectors], after: Sequence[FeatureVectors] = (),
    bearing: Bearing | None = None,
) -> Mapping[str, Curve]:  # fmt: skip
    """Curves of each domain by name: medians over records, with bands that contain 90 % of them.

    One for each `CurveStyle` of the domains, that of the envelope by fault ("envelope-outer"), and "condition" (RMS by
    fault or speed). The bearing's orders are marked on the envelope spectra.
    """
    conditions, sides = real.conditions, ([real], before, after)
    out = {}
    for name in real.domains:
        axis = real.axes[name]
        for style in DOMAIN[name].curves:
            chosen = np.flatnonzero(np.array(axis.kind) == style.kind)
            x = tuple(float(v) for v in (axis.lo[chosen] + axis.hi[chosen])[: chosen.size] / 2)
            for fault in (_known_faults(conditions) if style.name == "envelope" else ()) or ("",):
                places = np.flatnonzero([fault in ("", c.fault) for c in conditions])
                tables = [[v.values[name][np.ix_(places, chosen)] * style.factor for v in side] for side in sides]
                key, title, marks = style.name, style.title, {}
                if fault:
                    key, title = f"{key}-{fault}", f"{title}, {_FAULT_WORDS.get(fault, fault)}"
                    marks = _marks(bearing, fault, float(axis.hi.max()))
                out[key] = _curve(x, axis.unit, style.y_unit, title, name, tables, marks)
    if "condition" in real.domains:
        parts = strata(conditions)
        labels = tuple(_label([conditions[i] for i in places]) for places in parts)

        def by_stratum(v: FeatureVectors) -> Array:
            rms = v.values["condition"][:, 0] * 2 * PER_DECIBEL
            table = np.full((max(map(len, parts)), len(parts)), np.nan)
            for k, places in enumerate(parts):
                table[: len(places), k] = rms[places]
            return table

        tables = [[by_stratum(v) for v in side] for side in sides]
        unit = "dB of healthy rms"
        out["condition"] = _curve(labels, "condition", unit, "Level by condition", "condition", tables, {})
    return out


def _known_faults(conditions: Sequence[Condition]) -> list[str]:
    """Faults that are known of at least two records, in the order of `_FAULT_WORDS`."""
    counts = Counter(c.fault for c in conditions if c.fault is not None)
    known = [fault for fault, count in counts.items() if count > 1]
    order = [*_FAULT_WORDS, *known]
    return sorted(known, key=order.index)


def _marks(bearing: Bearing | None, fault: str, largest: float) -> dict[str, float]:
    """Orders to mark on an envelope spectrum: those of the bearing and the shaft, and multiples of the fault's own."""
    if bearing is None:
        return {}
    orders = {"FTF": bearing.ftf, "shaft": 1.0, "BPFO": bearing.bpfo, "BPFI": bearing.bpfi, "2 BSF": 2 * bearing.bsf}
    name = {"outer": "BPFO", "inner": "BPFI", "ball": "2 BSF", "cage": "FTF"}.get(fault)
    if name is not None:
        times = {"2 BSF": ("4 BSF", "6 BSF")}.get(name, (f"2 {name}", f"3 {name}"))
        orders |= {words: (k + 2) * orders[name] for k, words in enumerate(times)}
    return {words: float(order) for words, order in orders.items() if order <= largest}


def _curve(
    x: tuple[float, ...] | tuple[str, ...], x_unit: str, y_unit: str, title: str, domain: DomainName,
    tables: Sequence[Sequence[Array]], marks: Mapping[str, float],
) -> Curve:  # fmt: skip
    """Curve from values [records, places] of the records, and of replicates before and after."""
    middle, bands = {}, {}
    for name, own in zip(("real", "before", "after"), tables, strict=True):
        if own:
            v = np.concatenate(own)
            quantile = np.nanquantile if np.isnan(v).any() else np.quantile  # many times as fast
            low, middle[name], high = (tuple(row.tolist()) for row in quantile(v, (0.05, 0.5, 0.95), axis=0))
            bands[name] = low, high
    lines = middle["real"], middle["before"], middle.get("after")
    return Curve(x, x_unit, *lines, y_unit, title, domain, bands, marks=marks)


def _label(conditions: Sequence[Condition]) -> str:
    faults = dict.fromkeys(c.fault or "unknown fault" for c in conditions)
    speeds = [c.speed_rpm for c in conditions]
    low, high = min(speeds), max(speeds)
    speed = f"{low:.0f}" if high - low < 0.01 * high else f"{low:.0f} to {high:.0f}"
    loads = [c.load_n for c in conditions if c.load_n is not None]
    load = ""
    if loads and len(loads) == len(speeds):
        load = f", {' to '.join(dict.fromkeys(f'{end:g}' for end in (min(loads), max(loads))))} N"
    return f"{'/'.join(faults)}, {speed} rpm{load}"
