"""Disturbances: tones of the machine and of the supply, background noise, bursts.

motion, time --> tones at shaft orders, ball-pass orders, teeth, mains, drive; coloured noise
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.rigs.worlds.excitation import Effects, random_impacts
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.motion import Motion, fault_order
from twingap.streams import Streams

Array = NDArray[np.float64]


def tones(turns: Array, lines: Iterable[tuple[float, float]], rng: np.random.Generator, spread: float) -> Array:
    """Sum of tones of (order, amplitude) over an angle in turns; amplitudes vary by `spread` from record to record."""
    total = np.zeros(turns.size)
    for order, amplitude in lines:
        level = amplitude * np.exp(spread * rng.standard_normal())
        total += level * np.cos(2 * np.pi * (order * turns + rng.uniform()))
    return total


def mechanical(layout: Layout, motion: Motion, effects: Effects, streams: Streams, t: Array) -> Array:
    """Mechanical disturbances at the sensor [samples]."""
    total = np.zeros(t.size)
    turns = motion.turns(t)
    if p := effects.get("shaft_harmonics"):
        lines = [(k + 1.0, a) for k, a in enumerate(p["amplitudes"])]
        total += tones(turns, lines, streams("shaft_harmonics"), 0.1)
    if p := effects.get("looseness"):
        lines = [(0.5 * (k + 1), a) for k, a in enumerate(p["amplitudes"])]
        total += tones(turns, lines, streams("looseness"), 0.25)
    if p := effects.get("gear_mesh"):
        lines = []
        for k, a in enumerate(p["amplitudes"], start=1):
            lines.append((k * p["teeth"], a))
            for side, share in enumerate(p["sideband_ratios"], start=1):
                lines += [(k * p["teeth"] - side, a * share), (k * p["teeth"] + side, a * share)]
        total += tones(turns, lines, streams("gear_mesh"), 0.1)
    if p := effects.get("waviness"):
        order = fault_order(layout.bearing, p["race"], motion.cage_ratio / layout.bearing.ftf)
        lines = [(k * order, a) for k, a in enumerate(p["amplitudes"], start=1)]
        total += tones(turns, lines, streams("waviness"), 0.1)
    if p := effects.get("line_spectrum"):
        lines = list(zip(p["orders"], p["order_amplitudes"], strict=True))
        total += tones(turns, lines, streams("line_spectrum orders"), 0.1)
    if p := effects.get("coloured_noise"):
        total += coloured(p, t.size, layout.fs_hz, streams("coloured_noise"))
    if p := effects.get("whirl"):
        rng = streams("whirl")
        step_s = t[1] - t[0]
        # A diffusing phase gives a line of finite width below half order, with its second harmonic.
        phase = np.cumsum(np.sqrt(2 * np.pi * p["width_hz"] * step_s) * rng.standard_normal(t.size))
        turn = 2 * np.pi * (p["order"] * turns + rng.uniform()) + phase
        total += p["amplitude"] * (np.cos(turn) + p["second_ratio"] * np.cos(2 * turn))
    if p := effects.get("squeal"):
        total += squeal(p, t, streams("squeal"))
    return total


def electrical(motion: Motion, effects: Effects, streams: Streams, t: Array, fs_hz: float) -> Array:
    """Electrical disturbances after the sensor [samples]."""
    total = np.zeros(t.size)
    if p := effects.get("mains_interference"):
        lines = [(float(k), a) for k, a in zip(p["harmonics"], p["amplitudes"], strict=True)]
        total += tones(p["mains_hz"] * t, lines, streams("mains_interference"), 0.1)
    if p := effects.get("drive_interference"):
        rng = streams("drive_interference")
        carrier = p["carrier_hz"] * t + rng.uniform()
        side = p["pole_pairs"] * motion.turns(t) + rng.uniform()
        if not p.get("suppressed"):
            total += p["amplitude"] * np.cos(2 * np.pi * carrier)
        for k, share in enumerate(p["sideband_ratios"], start=1):
            for sign in (-1, 1):
                total += p["amplitude"] * share * np.cos(2 * np.pi * (carrier + sign * k * side + rng.uniform()))
    if p := effects.get("line_spectrum"):
        rng = streams("line_spectrum")
        total += tones(t, zip(p["frequencies_hz"], p["amplitudes"], strict=True), rng, 0.1)
        turns = motion.turns(t)
        for carrier, order, amplitude in zip(
            p["carriers_hz"], p["carrier_orders"], p["carrier_amplitudes"], strict=True
        ):
            level = amplitude * np.exp(0.1 * rng.standard_normal())
            total += level * np.cos(2 * np.pi * (carrier * t + order * turns + rng.uniform()))
    if (p := effects.get("impulsive_noise")) and not p["through_structure"]:
        at, size = random_impacts(p, t[0], t[-1] - t[0], streams)
        length = int(8 * p["decay_s"] * fs_hz) + 2
        steps = np.arange(length) / fs_hz
        spike = np.exp(-steps / p["decay_s"]) * np.cos(2 * np.pi * p["ring_hz"] * steps)
        comb = np.zeros(t.size)
        np.add.at(comb, np.clip(((at - t[0]) * fs_hz).astype(np.int64), 0, t.size - 1), size * p["peak"])
        total += signal.lfilter(spike, [1.0], comb)
    return total


def coloured_filter(p: Mapping[str, Any], fs_hz: float) -> tuple[Array, Array]:
    """Filter (b, a) that colours white noise: a band, or a slope."""
    if p["shape"] == "band":
        f0, half = p["centre_hz"], 0.5 * p["bandwidth_hz"]
        b, a = signal.butter(2, [f0 - half, f0 + half], btype="bandpass", fs=fs_hz)
        return np.asarray(b), np.asarray(a)
    # Slope: first order per 6 dB an octave, above a corner.
    r = np.exp(-2 * np.pi * p["corner_hz"] / fs_hz)
    a = np.array([1.0])
    for _ in range(int(p["poles"])):
        a = np.convolve(a, [1.0, -r])
    return np.array([(1 - r) ** int(p["poles"])]), a


def coloured(p: Mapping[str, Any], n: int, fs_hz: float, rng: np.random.Generator) -> Array:
    """Stationary coloured noise [n]."""
    b, a = coloured_filter(p, fs_hz)
    return np.asarray(p["white_equivalent_rms"] * signal.lfilter(b, a, rng.standard_normal(n)))


def squeal(p: Mapping[str, Any], t: Array, rng: np.random.Generator) -> Array:
    """Bursts of a friction-driven tone of varying frequency [samples]."""
    total = np.zeros(t.size)
    for _ in range(1 + rng.poisson(p["bursts_per_s"] * (t[-1] - t[0]))):
        at, length = rng.uniform(t[0], t[-1]), p["burst_s"] * rng.uniform(0.6, 1.4)
        inside = slice(*np.searchsorted(t, [at, at + length]))
        s = t[inside] - at
        sweep = p["sweep_fraction"] * rng.uniform(-1, 1)
        hz = p["frequency_hz"] * (1 + sweep * s / length)
        total[inside] += p["amplitude"] * np.sin(np.pi * s / length) ** 2 * np.cos(2 * np.pi * hz * s)
    return total
