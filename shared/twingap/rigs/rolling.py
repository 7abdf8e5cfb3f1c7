"""What the rolling elements do to the machine: where they are, when they strike a defect, and how hard.

shaft speed -> cage and spin angles (slip, play) -> strikes (time, strength, direction, duration) -> force [2, samples]

Written apart from the simulators in `twingap.twins`, on other assumptions: the cage slips as a slow random process,
each roller has its own place in its pocket, a strike is a force pulse of finite length with the 3/2-power shape of a
Hertzian contact, a ball's pit wanders out of the contact track.
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
    """Angles over time, in turns, all from a random start.

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
class Strikes:
    """Contacts of rolling elements with a defect.

    Parameters
    ----------
    time_s, strength_n, direction_rad, duration_s : Array [strikes]
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
    """Shaft with small speed wander, cage with mean slip `slip` (a fraction, positive = slower) and wander about it."""
    hz = speed_rpm / 60 * (1 + 4e-4 * slow_noise(rng, n, fs_hz, 0.3))
    cage_hz = hz * bearing.ftf * (1 - slip + 1.5e-3 * slow_noise(rng, n, fs_hz, 0.05))
    # Without slip at the inner race the roller turns with the speed of the inner ring relative to the cage.
    spin_hz = (hz - cage_hz) * bearing.bsf / (1 - bearing.ftf)
    shaft, cage, spin = (np.cumsum(v) / fs_hz + rng.uniform(0, 1) for v in (hz, cage_hz, spin_hz))
    return Motion(np.arange(n) / fs_hz, shaft, cage, spin)


def load_share(direction_rad: Array, zone: float) -> Array:
    """Load on a roller at this angle over that on the lowest one (Stribeck); `zone`, in (0, 1], is the load zone."""
    depth = 1 - (1 - np.cos(direction_rad - LOAD_DIRECTION)) / (2 * zone)
    return np.asarray(np.maximum(depth, 0.0) ** 1.5)


def _passes(turns: Array, t: Array, offset: float) -> Array:
    """Times at which `turns` + offset crosses a whole number."""
    first, last = np.ceil(turns[0] + offset), np.floor(turns[-1] + offset)
    return np.interp(np.arange(first, last + 1) - offset, turns, t)


def strikes(
    bearing: Bearing, fault: str, size_mm: float, load_n: float, zone: float, motion: Motion, rng: np.random.Generator
) -> Strikes:
    """All strikes of one defect during a motion.

    Parameters
    ----------
    bearing : Bearing
    fault : {"inner", "outer", "ball"}
    size_mm : float
        Diameter of the pit.
    load_n : float
        Radial load.
    zone : float
        Load zone factor; 0.5 loads the lower half.
    motion : Motion
    rng : numpy.random.Generator
        Places of rollers in their pockets, play, scatter.

    Returns
    -------
    Strikes
        Entry (soft, weak) and exit (hard) of every pass.
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
    if fault == "ball":  # the ball also turns about other axes: its pit is in the track only part of the time
        in_track = np.maximum(0.0, 0.55 + 0.45 * slow_noise(rng, motion.t.size, 1 / float(motion.t[1]), 0.15))
        strength *= 0.6 * np.interp(time_s, motion.t, in_track)
    strength *= np.exp(rng.normal(0, 0.25, time_s.size))
    # Roller centre relative to the race; play in the pocket moves single strikes by about a per cent of their spacing.
    speed_mm_s = 2 * np.pi * radius_mm * (motion.cage[-1] - motion.cage[0]) / motion.t[-1]
    if fault == "inner":
        speed_mm_s *= (1 - bearing.ftf) / bearing.ftf
    spacing_s = motion.t[-1] / max(time_s.size, 1)
    time_s = time_s + rng.normal(0, 0.008 * spacing_s, time_s.size)
    crossing_s = size_mm / speed_mm_s
    return Strikes(
        time_s=np.concatenate([time_s, time_s + crossing_s]),
        strength_n=np.concatenate([-0.35 * strength, strength]),
        direction_rad=np.concatenate([direction, direction]),
        duration_s=np.concatenate(
            [np.full(time_s.size, 3 * crossing_s), np.full(time_s.size, 0.5 * crossing_s + 6e-5)]
        ),
    )


def force(strike: Strikes, n: int, fs_hz: float) -> Array:
    """Force over time of all strikes, each a pulse sin(pi s)^(3/2), 0 < s < 1.

    Returns
    -------
    Array [2, samples]
        Along x and y, N.
    """
    total = np.zeros((2, n))
    if strike.time_s.size == 0:
        return total
    length = int(np.ceil(strike.duration_s.max() * fs_hz)) + 1
    first = np.ceil(strike.time_s * fs_hz).astype(np.int64)
    places = first[:, None] + np.arange(length)
    s = (places / fs_hz - strike.time_s[:, None]) / strike.duration_s[:, None]
    pulse = strike.strength_n[:, None] * np.sin(np.pi * np.clip(s, 0.0, 1.0)) ** 1.5
    inside = (places >= 0) & (places < n)
    for axis, weight in enumerate((np.cos(strike.direction_rad), np.sin(strike.direction_rad))):
        values = (pulse * weight[:, None])[inside]
        total[axis] = np.bincount(places[inside], weights=values, minlength=n)
    return total
