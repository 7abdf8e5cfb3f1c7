"""Changes that no catalogued effect describes, so that what is learnt can tell when it knows no name.

record --STFT--> gains or noise of random shape over the time-frequency plane --inverse--> record

One generic mechanism on purpose: what real machines have beyond the catalogue is not known, so no list of suspects is
learnt, only that something is left over. The shape follows neither shaft, bearing nor record set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import hann

from twingap.records import Record, RecordSet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Plan:
    """What happens to every record of a set; where it begins differs from record to record."""

    kind: str
    over_time: str
    rate_hz: float
    low: float
    high: float
    strength: float
    segment: int


def estrange(records: RecordSet, rng: np.random.Generator) -> RecordSet:
    """The records with something strange in them, of the same nature in all (or in half) of them."""
    n = min(c.n_samples for c in records.conditions)
    duration_s = min(c.duration_s for c in records.conditions)
    low = rng.uniform(0.0, 0.4)
    plan = _Plan(
        kind=str(rng.choice(["gain", "noise", "scrambled", "fold"])),
        over_time=str(rng.choice(["ramp", "step", "wave", "pulses", "even"])),
        rate_hz=float(np.exp(rng.uniform(np.log(1.5 / duration_s), np.log(60)))),
        low=low,
        high=min(low + rng.uniform(0.05, 0.6), 0.5),
        strength=float(np.exp(rng.uniform(np.log(0.5), np.log(2.5)))),
        segment=min(2 ** int(rng.integers(5, 9)), n // 8),
    )
    if plan.over_time == "even" and plan.kind == "gain":
        plan = replace(plan, kind="scrambled")
    part = 1.0 if rng.random() < 0.7 else 0.5
    out = [Record(r.condition, _changed(r, plan, rng) if rng.random() < part else r.samples) for r in records]
    return RecordSet.from_records(records.name, records.unit, records.bearing, out)


def _changed(record: Record, plan: _Plan, rng: np.random.Generator) -> Array:
    x, fs_hz = record.samples, record.condition.fs_hz
    if plan.kind == "fold":  # a part of the record returns where it does not belong: mirrored in time, and weaker
        return np.asarray(x + min(plan.strength, 1.0) * 0.6 * x[::-1] * _shape(np.arange(x.size) / fs_hz, plan, rng))
    hop = max(plan.segment // 4, 1)
    transform = ShortTimeFFT(hann(plan.segment, sym=False), hop, fs_hz)
    tiles = transform.stft(x)
    f = np.linspace(0, 0.5, tiles.shape[0])
    band = ((f >= plan.low) & (f <= plan.high)).astype(float)[:, None]
    shape = _shape(transform.t(x.size), plan, rng)[None, :] * band
    if plan.kind == "gain":
        tiles = tiles * np.exp(plan.strength * (shape - 0.5 * band))
    elif plan.kind == "noise":
        level = np.sqrt((np.abs(tiles) ** 2 * band).mean() / max(band.mean(), 1e-6))
        noise = rng.standard_normal((*tiles.shape, 2)).view(complex)[..., 0] / np.sqrt(2)
        tiles = tiles + plan.strength * level * shape * noise
    else:
        turned = np.exp(2j * np.pi * rng.random(tiles.shape))
        tiles = np.where(shape > 0.5, tiles * turned, tiles)
    return np.asarray(transform.istft(tiles, k1=x.size))


def _shape(t: Array, plan: _Plan, rng: np.random.Generator) -> Array:
    """Between 0 and 1 over time."""
    span = max(float(t[-1] - t[0]), 1e-9)
    if plan.over_time == "even":
        return np.ones_like(t)
    if plan.over_time == "ramp":
        return np.asarray(np.clip((t - t[0]) / span, 0, 1))
    if plan.over_time == "step":
        return np.asarray((t > t[0] + span * rng.uniform(0.2, 0.8)).astype(float))
    phase = rng.random()
    wave = 0.5 + 0.5 * np.cos(2 * np.pi * (plan.rate_hz * t + phase))
    return np.asarray(wave if plan.over_time == "wave" else wave**12)
