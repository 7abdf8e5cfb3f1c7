"""Level of a user's own model: its factor on all samples, and the healthy vibration that effects are relative to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.signal import welch

from twingap.identification.baseline import level_of_own
from twingap.identification.result import Fit
from twingap.records import Condition, Record, RecordSet
from twingap.signal.record_transforms import Frame
from twingap.streams import root_entropy
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec, all_parameters, flat, nested

_SEGMENT: Final = 1024
"""Samples of a segment of the spectra that are drawn."""


def levelled(
    spec: TwinSpec, records: RecordSet, rng: np.random.Generator, notes: list[str]
) -> tuple[TwinSpec, dict[str, float]]:
    """A user's model with `scale` matched to the records, and `healthy_rms` that of its own healthy records.

    Only parameters that it has and the file leaves open. The level is matched band by band without tones
    (`baseline.level_of_own`).

    Parameters
    ----------
    spec : TwinSpec
    records : RecordSet
        A few of each state; of a known bearing.
    rng : numpy.random.Generator
    notes : list of str
        Notes are added.

    Returns
    -------
    TwinSpec, dict[str, float]
        The twin, and the values that were found.
    """
    names, bearing = flat(all_parameters(spec)), records.bearing or spec.bearing
    free = [name for name in ("scale", "healthy_rms") if name in names and not spec.given(name)]
    if not free or bearing is None:
        notes.append(f"model {spec.model!r} has no free parameters: its parameters are not changed")
        return spec, {}
    root = root_entropy(rng)
    made = TwinSimulator(spec, bearing, records.unit).simulate((), records.conditions, root, 0)
    found: dict[str, float] = {}
    if "healthy_rms" in free:
        kept = {name: value for name, value in spec.parameters.items() if name not in spec.effects}
        bare = made
        if spec.effects:
            plain = TwinSimulator(replace(spec, effects=(), parameters=kept), bearing, records.unit)
            bare = plain.simulate((), records.conditions, root, 0)
        power = [float(m.samples.var()) for m in bare if m.condition.fault == "healthy"]
        if power:
            found["healthy_rms"] = math.sqrt(float(np.mean(power))) / float(names["scale"])
    if "scale" in free:
        by_name = {m.condition.name: m for m in made}

        def at(level: float, conditions: Sequence[Condition]) -> list[Record]:
            return [Record(c, level * by_name[c.name].samples) for c in conditions]

        frame = Frame(bearing, (0.0, min(c.fs_hz for c in records.conditions) / 2), 1.0)
        found["scale"] = float(names["scale"]) * level_of_own(at, list(records), frame)
        notes.append(f"model {spec.model!r}: its level was brought to the records' by scale = {found['scale']:.4g}")
    return replace(spec, parameters=nested(flat(spec.parameters) | found)), found


def first_of_each_state(records: RecordSet, most: int = 6) -> RecordSet:
    """At most `most` records of each state."""
    counts: dict[str | None, int] = {}
    kept = []
    for place, condition in enumerate(records.conditions):
        counts[condition.fault] = counts.get(condition.fault, 0) + 1
        if counts[condition.fault] <= most:
            kept.append(place)
    return records.take(kept)


def fits_of(twin: TwinSpec, records: RecordSet) -> tuple[Fit, ...]:
    """Mean spectra of records and twin, one for each state."""
    bearing = records.bearing or twin.bearing
    made = TwinSimulator(twin, bearing, records.unit).simulate((), records.conditions, 0, 0)
    out = []
    for state in dict.fromkeys(c.fault for c in records.conditions):
        pairs = [(r, m) for r, m in zip(records, made, strict=True) if r.condition.fault == state]
        fs_hz = pairs[0][0].condition.fs_hz
        sides = [[one[side] for one in pairs if one[0].condition.fs_hz == fs_hz] for side in (0, 1)]
        segment = min(_SEGMENT, *(r.samples.size for r in sides[0]))
        f_hz, _ = welch(sides[0][0].samples, fs_hz, nperseg=segment)
        real, simulated = (np.mean([welch(r.samples, fs_hz, nperseg=segment)[1] for r in own], axis=0) for own in sides)
        used, peak_hz = np.ones(f_hz.size, bool), float(f_hz[np.argmax(simulated)])
        out.append(Fit(f"{state or 'unknown'} records", f_hz, real, simulated, used, peak_hz, records.unit))
    return tuple(out)
