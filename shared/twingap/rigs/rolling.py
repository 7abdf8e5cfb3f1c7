"""Motion of the rolling elements, their impacts on a defect, and the force of these impacts.

shaft speed -> cage and spin angles (slip, play) -> impacts (time, strength, direction, duration) -> force [2, samples]

Independent of the simulators in `twingap.twins`, with other assumptions: the slip of the cage is a slow random process,
each roller has its own position in its pocket, an impact is a force pulse of finite length with the 3/2-power shape of
a Hertzian contact, and a ball's pit is only part of the time in the contact track.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.bearing import Bearing

Array = NDArray[np.float64]
LOAD_DIRECTION = 1.5 * np.pi
"""Straight down (6 o'clock), rad."""


@dataclass(frozen=True)
class Motion:
    """Angles over time, in turns, each with a random start.

    Parameters
    ----------
    t : Array [samples]
        Time, s.
    shaft, cage, spin : Array [samples]
        Angle of shaft and cage in the fixed frame, and of a roller about its own axis seen from the cage.
    """

    t: Array
    shaft: Array
    cage: Array
    spin: Array


@dataclass(frozen=True)
class Impacts:
    """Contacts of rolling elements with a defect.

    Parameters
    ----------
    time_s, strength_n, direction_rad, duration_s : Array [impacts]
        Begin, s; peak force, N; direction of the force, rad; duration, s.
    """

    time_s: Array
    strength_n: Array
    direction_rad: Array
    duration_s: Array


def slow_noise(rng: np.random.Generator, n: int, fs_hz: float, time_constant_s: float) -> Array:
    """Stationary first-order (Ornstein-Uhlenbeck) noise of unit variance, started in its stationary state."""
    decay = float(np.exp(-1 / (fs_hz * time_constant_s)))
    start = decay * rng.standard_normal()
    steps = np.sqrt(1 - decay**2) * rng.standard_normal(n)
    values, _ = signal.lfilter([1.0], [1.0, -decay], steps, zi=np.array([start]))
    return np.asarray(values, dtype=np.float64)


def move(bearing: Bearing, speed_rpm: float, n: int, fs_hz: float, slip: float, rng: np.random.Generator) -> Motion:
    """Random motion of shaft and cage; `slip` is the mean slip of the cage (fraction, positive = slower)."""
    hz = speed_rpm / 60 * (1 + 4e-4 * slow_noise(rng, n, fs_hz, 0.3))
    cage_hz = hz * bearing.ftf * (1 - slip + 1.5e-3 * slow_noise(rng, n, fs_hz, 0.05))
    # Without slip at the inner race the roller turns with the speed of the inner ring relative to the cage.
    spin_hz = (hz - cage_hz) * bearing.bsf / (1 - bearing.ftf)
    shaft, cage, spin = (np.cumsum(v) / fs_hz + rng.uniform(0, 1) for v in (hz, cage_hz, spin_hz))
    return Motion(np.arange(n) / fs_hz, shaft, cage, spin)


def load_share(direction_rad: Array, zone: float) -> Array:
    """Load on a roller at this angle relative to the lowest one (Stribeck); `zone`, in (0, 1], is the load zone."""
    depth = 1 - (1 - np.cos(direction_rad - LOAD_DIRECTION)) / (2 * zone)
    return np.asarray(np.maximum(depth, 0.0) ** 1.5)


def _passes(turns: Array, t: Array, offset: float) -> Array:
    """Times at which `turns` + offset is an integer, s."""
    first, last = np.ceil(turns[0] + offset), np.floor(turns[-1] + offset)
    return np.interp(np.arange(first, last + 1) - offset, turns, t)


def impacts(
    bearing: Bearing, fault: str, size_mm: float, load_n: float, zone: float, motion: Motion, rng: np.random.Generator
) -> Impacts:
    """Impacts of all rolling elements on one defect during a motion.

    Parameters
    ----------
    bearing : Bearing
    fault : {"inner", "outer", "ball"}
    size_mm : float
        Diameter of the defect, mm.
    load_n : float
        Radial load, N.
    zone : float
        Load zone factor; with 0.5 the lower half is loaded.
    motion : Motion
    rng : numpy.random.Generator
        Generator of the rollers' positions in their pockets, their play, and the scatter of impacts.

    Returns
    -------
    Impacts
        Entry (long, weak) and exit (short, strong) of every pass.
    """
    places = (np.arange(bearing.n_rollers) + rng.normal(0, 0.01, bearing.n_rollers)) / bearing.n_rollers
    radius_mm = 0.5 * (bearing.pitch_diameter_mm + bearing.roller_diameter_mm)
    at: list[Array] = []
    where: list[Array] = []
    if fault == "outer":
        for place in places:
            at.append(_passes(motion.cage, motion.t, place - LOAD_DIRECTION / (2 * np.pi)))
            where.append(np.full(at[-1].size, LOAD_DIRECTION))
    elif fault == "inner":
        radius_mm = 0.5 * (bearing.pitch_diameter_mm - bearing.roller_diameter_mm)
        for place in places:
            at.append(_passes(motion.shaft - motion.cage, motion.t, -place))
            where.append(2 * np.pi * np.interp(at[-1], motion.t, motion.shaft))
    else:  # a ball's pit meets the outer race once per spin and the inner race half a spin later
        for offset in (0.0, 0.5):
            at.append(_passes(motion.spin, motion.t, offset))
            where.append(2 * np.pi * np.interp(at[-1], motion.t, motion.cage))
    time_s, direction = np.concatenate(at), np.concatenate(where)
    order = np.argsort(time_s)
    time_s, direction = time_s[order], direction[order]

    strength = 0.02 * load_n * (size_mm / 0.36) ** 0.7 * (0.1 + load_share(direction, zone))
    if fault == "ball":  # the ball also rotates about other axes: its pit is in the track only part of the time
        in_track = np.maximum(0.0, 0.55 + 0.45 * slow_noise(rng, motion.t.size, 1 / float(motion.t[1]), 0.15))
        strength *= 0.6 * np.interp(time_s, motion.t, in_track)
    strength *= np.exp(rng.normal(0, 0.25, time_s.size))
    # Roller centre relative to the race; play in the pocket shifts single impacts by about 1 % of their spacing.
    speed_mm_s = 2 * np.pi * radius_mm * (motion.cage[-1] - motion.cage[0]) / motion.t[-1]
    if fault == "inner":
        speed_mm_s *= (1 - bearing.ftf) / bearing.ftf
    spacing_s = motion.t[-1] / max(time_s.size, 1)
    time_s = time_s + rng.normal(0, 0.008 * spacing_s, time_s.size)
    crossing_s = size_mm / speed_mm_s
    return Impacts(
        time_s=np.concatenate([time_s, time_s + crossing_s]),
        strength_n=np.concatenate([-0.35 * strength, strength]),
        direction_rad=np.concatenate([direction, direction]),
        duration_s=np.concatenate(
            [np.full(time_s.size, 3 * crossing_s), np.full(time_s.size, 0.5 * crossing_s + 6e-5)]
        ),
    )


def force(pulses: Impacts, n: int, fs_hz: float) -> Array:
    """Force over time of all impacts, each a pulse of shape sin(pi s)^(3/2), 0 < s < 1.

    Returns
    -------
    Array [2, samples]
        Along x and y, N.
    """
    total = np.zeros((2, n))
    if pulses.time_s.size == 0:
        return total
    length = int(np.ceil(pulses.duration_s.max() * fs_hz)) + 1
    first = np.ceil(pulses.time_s * fs_hz).astype(np.int64)
    places = first[:, None] + np.arange(length)
    s = (places / fs_hz - pulses.time_s[:, None]) / pulses.duration_s[:, None]
    pulse = pulses.strength_n[:, None] * np.sin(np.pi * np.clip(s, 0.0, 1.0)) ** 1.5
    inside = (places >= 0) & (places < n)
    for axis, weight in enumerate((np.cos(pulses.direction_rad), np.sin(pulses.direction_rad))):
        values = (pulse * weight[:, None])[inside]
        total[axis] = np.bincount(places[inside], weights=values, minlength=n)
    return total
