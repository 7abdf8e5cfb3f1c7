"""Effects outside the catalogue, for training the detection of gaps that no catalogued effect explains.

record --STFT--> gains or noise of random shape over the time-frequency plane --inverse--> record
       --band with time-varying frequencies--> record
       --random nonlinearity--> record
       --random echoes--> record
       --random level of each record--> record

The mechanisms are generic, one for each axis of a record. What real machines have beyond the catalogue is unknown, so
that no specific mechanism is learnt, only the presence of a rest. The shapes are independent of shaft, bearing and
record set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.signal import hilbert, istft, stft

from twingap.effects.drawing import log_uniform
from twingap.records import Array, Record, RecordSet


@dataclass(frozen=True)
class _Plan:
    """Parameters of the change common to all records of a set; its onset is drawn for each record."""

    kind: str
    over_time: str
    rate_hz: float
    low: float
    high: float
    strength: float
    segment: int
    entropy: int  # of what is common to all records of a set: a nonlinearity, a set of echoes


_KINDS: Final = {
    "gain": 0.16, "noise": 0.17, "scrambled": 0.12, "shift": 0.14, "fold": 0.08, "curve": 0.15, "taps": 0.12,
    "level": 0.06,
}  # fmt: skip
"""Kinds of change of a record, with their probabilities. A larger one gives more training examples of that kind."""
_REMOUNTED: Final = 0.12
"""Standard deviation of the logarithm of a record's level at strength 1, as by remounting a sensor. A larger value
makes the change easier to detect."""
_FARTHEST: Final = 0.016
"""Largest deviation of a band's frequencies at strength 1, as a part of the sampling rate. A larger value makes the
change easier to detect."""


def with_outside_effect(records: RecordSet, rng: np.random.Generator) -> RecordSet:
    """The records with an effect outside the catalogue, of the same kind in all (or about half) of them."""
    n = min(c.n_samples for c in records.conditions)
    duration_s = min(c.duration_s for c in records.conditions)
    low = rng.uniform(0.0, 0.4)
    plan = _Plan(
        kind=str(rng.choice(list(_KINDS), p=list(_KINDS.values()))),
        over_time=str(rng.choice(["ramp", "step", "wave", "pulses", "even"])),
        rate_hz=log_uniform(rng, 1.5 / duration_s, 60),
        low=low,
        high=min(low + rng.uniform(0.05, 0.6), 0.5),
        strength=log_uniform(rng, 0.5, 2.5),
        segment=min(2 ** int(rng.integers(5, 9)), n // 8),
        entropy=int(rng.integers(2**62)),
    )
    if plan.over_time == "even" and plan.kind == "gain":
        plan = replace(plan, kind="scrambled")
    if plan.over_time == "even" and plan.kind == "shift":  # a constant shift is a change of path, which twins can have
        plan = replace(plan, over_time="wave")
    part = 1.0 if rng.random() < 0.7 else 0.5
    out = [Record(r.condition, _changed(r, plan, rng) if rng.random() < part else r.samples) for r in records]
    return RecordSet.from_records(records.name, records.unit, records.bearing, out)


def _changed(record: Record, plan: _Plan, rng: np.random.Generator) -> Array:
    """Samples of a record with the change."""
    x, fs_hz = record.samples, record.condition.fs_hz
    if plan.kind == "level":
        return np.asarray(x * np.exp(_REMOUNTED * plan.strength * rng.standard_normal()))
    if plan.kind == "fold":  # time-reversed part of the record, attenuated
        return np.asarray(x + min(plan.strength, 1.0) * 0.6 * x[::-1] * _shape(np.arange(x.size) / fs_hz, plan, rng))
    if plan.kind in ("curve", "taps"):
        common = np.random.default_rng(plan.entropy)
        more = _curve(x, common) if plan.kind == "curve" else _taps(x, fs_hz, common)
        return np.asarray(x + 0.3 * plan.strength * more * _shape(np.arange(x.size) / fs_hz, plan, rng))
    if plan.kind == "shift":
        return _wandering(x, plan, _shape(np.arange(x.size) / fs_hz, plan, rng))
    # `stft` transforms all segments at once, `ShortTimeFFT` one by one, which is much slower for short segments.
    overlap = plan.segment - max(plan.segment // 4, 1)
    _, t, tiles = stft(x, fs_hz, "hann", plan.segment, overlap)
    f = np.linspace(0, 0.5, tiles.shape[0])
    band = ((f >= plan.low) & (f <= plan.high)).astype(float)[:, None]
    shape = _shape(t, plan, rng)[None, :] * band
    if plan.kind == "gain":
        tiles = tiles * np.exp(plan.strength * (shape - 0.5 * band))
    elif plan.kind == "noise":
        level = np.sqrt((np.abs(tiles) ** 2 * band).mean() / max(band.mean(), 1e-6))
        noise = rng.standard_normal((*tiles.shape, 2)).view(complex)[..., 0] / np.sqrt(2)
        tiles = tiles + plan.strength * level * shape * noise
    else:
        turned = np.exp(2j * np.pi * rng.random(tiles.shape))
        tiles = np.where(shape > 0.5, tiles * turned, tiles)
    return np.asarray(istft(tiles, fs_hz, "hann", plan.segment, overlap)[1][: x.size])


def _wandering(x: Array, plan: _Plan, shape: Array) -> Array:
    """x with the frequencies of a band modulated over time about their mean."""
    spectrum, f = np.fft.rfft(x), np.fft.rfftfreq(x.size)
    inside = np.where((f >= plan.low) & (f <= plan.high), spectrum, 0.0)
    band = np.fft.irfft(inside, x.size)
    turns = np.cumsum(_FARTHEST * plan.strength * (shape - shape.mean()))
    return np.asarray(x - band + (hilbert(band) * np.exp(2j * np.pi * turns)).real)


def _curve(x: Array, rng: np.random.Generator) -> Array:
    """A random memoryless nonlinearity of x without constant and linear part, scaled to the RMS of x."""
    rms = max(float(x.std()), 1e-300)
    z = x / rms
    out = np.zeros_like(z)
    for _ in range(int(rng.integers(1, 4))):
        centre, width, height = rng.uniform(-2.5, 2.5), np.exp(rng.uniform(np.log(0.1), np.log(2.0))), rng.normal()
        out += height * np.tanh((z - centre) / width)
    out -= out.mean()
    out -= z * float(out @ z) / max(float(z @ z), 1e-300)
    return np.asarray(out * rms / max(float(out.std()), 1e-3))


def _taps(x: Array, fs_hz: float, rng: np.random.Generator) -> Array:
    """Sum of a few random echoes of x, some of them inverted, scaled to the RMS of x."""
    longest = min(0.3 * x.size / fs_hz, 0.1)
    out = np.zeros_like(x)
    for _ in range(int(rng.integers(1, 4))):
        later = max(int(fs_hz * np.exp(rng.uniform(np.log(3 / fs_hz), np.log(longest)))), 1)
        out[later:] += rng.uniform(-1, 1) * x[:-later]
    return np.asarray(out * float(x.std()) / max(float(out.std()), 1e-300))


def _shape(t: Array, plan: _Plan, rng: np.random.Generator) -> Array:
    """[times] Envelope of the change over time, between 0 and 1."""
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
