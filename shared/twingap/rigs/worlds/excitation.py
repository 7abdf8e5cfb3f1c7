"""Force on the structure: impacts of the defect, of another bearing and at random times, and rolling noise.

motion, fault --> times and impulses of impacts --(scatter, load zone, cage, speed, run; entry and exit)--> force
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.rigs.worlds.base import OVERSAMPLING, Base
from twingap.rigs.worlds.case import ENTRY_EXIT
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.motion import Motion, deposit, fault_order, grid_s
from twingap.streams import Streams

Array = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, Any]]


def speed_deviation(p: Mapping[str, Any], start_s: float, end_s: float, rng: np.random.Generator) -> Array:
    """Relative deviation of the shaft speed on the motion's grid: a sinusoid and slow noise, RMS `rms_fraction`."""
    t = grid_s(start_s, end_s)
    swing = np.sqrt(2) * np.cos(2 * np.pi * (p["rate_hz"] * t + rng.uniform()))
    # Slow noise: random tones below 3 times the rate, smooth by construction.
    rates = p["rate_hz"] * rng.uniform(0.2, 3.0, 6)
    noise = np.sqrt(2 / 6) * np.cos(2 * np.pi * (np.outer(t, rates) + rng.uniform(size=6))).sum(axis=1)
    share = p["swing_share"]
    return np.asarray(p["rms_fraction"] * (np.sqrt(share) * swing + np.sqrt(1 - share) * noise))


def load_weight(angle_rad: Array, extent: float) -> Array:
    """Stribeck's load distribution relative to its mean over the circle; `extent` in (0, 1) is the loaded fraction."""

    def zone(psi: Array) -> Array:
        return np.asarray(np.maximum(1 - (1 - np.cos(psi)) / (2 * extent), 0.0) ** 1.5)

    return np.asarray(zone(angle_rad) / zone(np.linspace(0, 2 * np.pi, 720, endpoint=False)).mean())


def fault_impacts(
    base: Base, layout: Layout, i: int, motion: Motion, effects: Effects, streams: Streams
) -> tuple[Array, Array, Array]:
    """Times, impulses and durations of the impacts of record i's defect."""
    fault, rpm = layout.fault[i], motion.hz * 60
    order = fault_order(layout.bearing, fault, motion.cage_ratio / layout.bearing.ftf)
    rng = streams("defect")
    phase, place = rng.uniform(size=2)
    turns = motion.passes(order, phase)
    angle = turns
    if p := effects.get("slip_jitter"):
        step = p["std_fraction"] / order * streams("slip_jitter").standard_normal(turns.size)
        if p["accumulates"]:
            # Without its mean, the random walk does not shift the impacts of a record as a whole.
            walk = np.cumsum(step)
            step = walk - walk.mean()
        angle = turns + step
    time_s = motion.time_s(angle)
    impulse, length = base.impact(fault, rpm, layout.load_n[i])
    weight = np.full(turns.size, impulse)
    if p := effects.get("impact_scatter"):
        draw = streams("impact_scatter")
        spread = p["std_fraction"]
        if p["shape"] == "lognormal":
            s2 = np.log1p(spread**2)
            weight = weight * np.exp(np.sqrt(s2) * draw.standard_normal(turns.size) - s2 / 2)
        else:
            weight = weight * draw.gamma(1 / spread**2, spread**2, turns.size)
    if p := effects.get("load_zone"):
        depth = p["depth_fraction"]
        if fault in ("inner", "ball"):  # the defect rotates with the shaft or with the cage
            around = turns if fault == "inner" else motion.cage(turns)
            weight = weight * (1 - depth + depth * load_weight(2 * np.pi * (around + place), p["extent_fraction"]))
    if p := effects.get("cage_modulation"):
        turn = 2 * np.pi * motion.cage(turns)
        swing = np.cos(turn) + p["second_share"] * np.cos(2 * turn + p["second_phase_rad"])
        weight = weight * np.maximum(1 + p["depth_fraction"] * swing, 0.0)
    if p := effects.get("speed_gain"):
        weight = weight * (rpm / p["reference_rpm"]) ** p["exponent"]
    if (p := effects.get("damage_growth")) and layout.time_s is not None:
        gone = (layout.time_s[i] - layout.time_s[0]) / (layout.time_s[-1] - layout.time_s[0])
        weight = weight * 10 ** (p["growth_db"] * (gone ** p["shape_exponent"] - 0.5) / 20)
    if p := effects.get("two_state_impacts"):
        weight = weight * telegraph(p["rate_per_s"], p["low_fraction"], time_s, streams("two_state_impacts"))
    lengths = np.full(turns.size, length)
    if p := effects.get(ENTRY_EXIT):
        entry = motion.time_s(angle - p["delay_fraction"] / order)
        time_s = np.concatenate([entry, time_s])
        weight = np.concatenate([p["entry_ratio"] * weight, weight])
        lengths = np.concatenate([p["entry_length_ratio"] * lengths, lengths])
    return time_s, weight, lengths


def telegraph(rate_per_s: float, low: float, t_s: Array, rng: np.random.Generator) -> Array:
    """Random telegraph signal [samples]: levels 1 and `low`, switched at random times."""
    first, last = float(t_s.min(initial=0.0)), float(t_s.max(initial=0.0))
    switches = np.sort(rng.uniform(first, last, rng.poisson(rate_per_s * (last - first)) + 1))
    state = (np.searchsorted(switches, t_s) + rng.integers(0, 2)) % 2
    return np.where(state == 0, 1.0, low)


def total_force(
    base: Base, layout: Layout, i: int, motion: Motion, effects: Effects, streams: Streams, start_s: float, n: int
) -> Array:
    """Force on the fine grid [n], from `start_s` on."""
    fine_hz = OVERSAMPLING * base.fs_hz
    scale = base.structure_scale(motion.hz * 60)
    noise = streams("structure").standard_normal(n)
    t = start_s + np.arange(n) / fine_hz
    if p := effects.get("swelling_noise"):
        noise *= swell(p, t, streams)
    force = scale * noise
    if p := effects.get("distributed_roughness"):
        rough = streams("distributed_roughness")
        place = rough.uniform()
        if p["correlation_s"] > 0:
            decay = float(np.exp(-1 / (p["correlation_s"] * fine_hz)))
            raw = signal.lfilter([np.sqrt(1 - decay**2)], [1.0, -decay], rough.standard_normal(n))
        else:
            raw = rough.standard_normal(n)
        turns = motion.turns(t)
        turn = 2 * np.pi * (turns + place)
        power = 1 + p["depth_fraction"] * (np.cos(turn) + p["second_share"] * np.cos(2 * turn))
        force += scale * p["rms_over_structure"] * np.sqrt(np.maximum(power, 0.0)) * raw
    parts = []
    if layout.fault[i] != "healthy":
        parts.append(fault_impacts(base, layout, i, motion, effects, streams))
    if p := effects.get("foreign_bearing"):
        draw = streams("foreign_bearing")
        turns = motion.passes(p["order"], draw.uniform())
        walk = np.cumsum(p["slip_fraction"] / p["order"] * draw.standard_normal(turns.size))
        parts.append(
            (motion.time_s(turns + walk - walk.mean()), np.full(turns.size, p["impulse"]), _same(turns, base.pulse_s))
        )
    if (p := effects.get("impulsive_noise")) and p["through_structure"]:
        at, size = random_impacts(p, start_s, n / fine_hz, streams)
        parts.append((at, size * p["impulse"], _same(at, base.pulse_s)))
    for time_s, impulse, length in parts:
        force += deposit(time_s, impulse, length, start_s, n, fine_hz, base.hertz)
    return np.asarray(force)


def _same(like: Array, value: float) -> Array:
    return np.full(like.size, value)


def random_impacts(p: Mapping[str, Any], start_s: float, length_s: float, streams: Streams) -> tuple[Array, Array]:
    """Times and relative sizes of impacts at random times (Poisson process)."""
    rng = streams("impulsive_noise")
    count = rng.poisson(p["rate_per_s"] * length_s)
    at = start_s + length_s * rng.uniform(size=count)
    return at, np.asarray(rng.choice([-1, 1], count) * rng.uniform(0.7, 1.4, count))


def swell(p: Mapping[str, Any], t_s: Array, streams: Streams) -> Array:
    """Factor on background noise whose level varies sinusoidally over time, independent of rotation [samples]."""
    phase = streams("swelling_noise").uniform()
    return np.asarray(np.sqrt(1 + p["depth_fraction"] * np.cos(2 * np.pi * (p["rate_hz"] * t_s + phase))))
