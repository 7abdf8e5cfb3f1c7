"""Samples of one record: motion, force, structure, sensor, channel and converter.

force -> structure -> + mechanical disturbances -> sensor -> + electrical ones -> channel -> gain -> converter
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.rigs.worlds.base import OVERSAMPLING, Base, Mode, path_modes
from twingap.rigs.worlds.disturbance import electrical, mechanical
from twingap.rigs.worlds.excitation import Effects, speed_deviation, swell, telegraph, total_force
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.motion import make_motion
from twingap.streams import Streams

Array = NDArray[np.float64]


def simulate(base: Base, layout: Layout, i: int, rpm: float, effects: Effects, streams: Streams) -> Array:
    """Samples of record i.

    Parameters
    ----------
    base : Base
    layout : Layout
    i : int
        Index of the record.
    rpm : float
        True mean shaft speed, rpm.
    effects : Mapping[str, Mapping[str, Any]]
        All effects, catalogued or not, with parameters.
    streams : Streams
        Random streams of this record, one for each effect.

    Returns
    -------
    Array [samples]
        In the record's unit.
    """
    fs, end_s = layout.fs_hz, layout.n_samples / layout.fs_hz
    settle = int(np.ceil(base.settle_s * fs))
    n, start_s = settle + layout.n_samples, -settle / fs
    t = start_s + np.arange(n) / fs
    deviation = None
    if p := effects.get("speed_fluctuation"):
        deviation = speed_deviation(p, start_s, end_s, streams("speed_fluctuation"))
    cage = layout.bearing.ftf * (1 + effects.get("mean_slip", {}).get("cage_speed_change", 0.0))
    motion = make_motion(rpm, start_s, end_s, cage, deviation, streams("motion").uniform(size=2))

    machine = base
    if p := effects.get("transfer_path"):
        machine = machine.with_modes(*path_modes(p))
    if p := effects.get("second_resonance"):
        machine = machine.with_modes(Mode(p["frequency_hz"], p["damping_ratio"], p["gain"]))
    force = total_force(machine, layout, i, motion, effects, streams, start_s, OVERSAMPLING * n)
    drift = None
    if p := effects.get("drifting_resonance"):
        fine = start_s + np.arange(force.size) / (OVERSAMPLING * fs)
        phase = streams("drifting_resonance").uniform()
        drift = p["swing_fraction"] * np.sin(2 * np.pi * (p["rate_hz"] * fine + phase))
    x = machine.path(force, drift)
    white = streams("white").standard_normal((2, n)) * base.white_rms
    if p := effects.get("swelling_noise"):
        white[0] *= swell(p, t, streams)
    x += np.sqrt(1 - base.electronic_share) * white[0]
    x += mechanical(layout, motion, effects, streams, t)
    x = _sensor(x, effects, fs)
    x += np.sqrt(base.electronic_share) * white[1] + electrical(motion, effects, streams, t, fs)
    x = _channel(x, t, effects, streams)[settle:]
    return converter(x * base.gain, effects, streams, fs)


def _sensor(x: Array, effects: Effects, fs_hz: float) -> Array:
    """Signal after mounting and sensor."""
    if p := effects.get("echo"):
        delay = round(p["delay_s"] * fs_hz)
        x = x.copy()
        x[delay:] += p["ratio"] * x[:-delay].copy()
    if p := effects.get("sensor_rolloff"):
        b, a = signal.butter(int(p["poles"]), p["corner_hz"], fs=fs_hz)
        x = np.asarray(signal.lfilter(b, a, x))
    if p := effects.get("sensor_asymmetry"):
        # Compressed on the positive side only; smooth and monotone.
        u = x / p["scale"]
        x = p["scale"] * np.where(u > 0, np.log1p(np.abs(u)), u)
    return x


def _channel(x: Array, t: Array, effects: Effects, streams: Streams) -> Array:
    """Signal after cable and amplifier."""
    if p := effects.get("gain_jumps"):
        x = x * telegraph(p["rate_per_s"], p["low_fraction"], t, streams("gain_jumps"))
    if p := effects.get("amplitude_beat"):
        phase = streams("amplitude_beat").uniform()
        x = x * (1 + p["depth_fraction"] * np.cos(2 * np.pi * (p["rate_hz"] * t + phase)))
    if p := effects.get("half_rectified"):
        x = np.where(x > 0, x, p["passed_fraction"] * x)
    if p := effects.get("crossover"):
        x = x**3 / (x**2 + p["dead_zone"] ** 2)
    if p := effects.get("interleave"):
        x = x * (1 + p["mismatch_fraction"] * (1 - 2 * (np.arange(x.size) % 2)))
    return x


def converter(x: Array, effects: Effects, streams: Streams, fs_hz: float) -> Array:
    """Signal after the converter: clipped, quantised, with dropouts."""
    if p := effects.get("clipping"):
        x = np.clip(x, p["low"], p["high"])
    if p := effects.get("quantisation"):
        x = p["step"] * np.round(x / p["step"])
    if p := effects.get("dropout"):
        rng = streams("dropout")
        x = x.copy()
        for _ in range(rng.poisson(p["stretches_per_s"] * x.size / fs_hz)):
            length = max(3, round(p["length_s"] * rng.uniform(0.6, 1.4) * fs_hz))
            first = int(rng.integers(1, max(2, x.size - length)))
            x[first : first + length] = x[first - 1] if p["fill"] == "hold" else 0.0
    return np.asarray(x, dtype=np.float64)
