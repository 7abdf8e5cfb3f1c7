"""Virtual machine with drifting parameters: temperature, oil viscosity, a seat that wears, fresh oil.

speed, load (steps), cooling water --> friction heat --> ring temperatures --> clearance, oil viscosity --> damping
wear (slow), fresh oil (sudden) ----------------------------------> contact stiffness, damping
                 these parameters --> ring and housing on unequal balls, excited by rough surfaces --> sensor on the
                 housing

Independent of `twingap.twins`, with other assumptions: two bodies instead of one (the sensor on the housing measures
the forces that the contacts transmit), balls of unequal size, velocity Verlet instead of Runge-Kutta, Vogel's viscosity
law with a power of 0.7 for the film's damping, two thermal nodes with a lag, a second structural mode, shaft tones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.streams import Streams

Array = NDArray[np.float64]
OVERSAMPLING = 8
"""Steps of the integration per sample; fewer make it less accurate."""
SETTLING_S = 0.08
"""Time simulated before each recording and discarded, s."""
AMBIENT_C = 20.0
RING_KG, HOUSING_KG = 0.6, 9.0
HOUSING_HZ, HOUSING_ZETA = 320.0, 0.05
EXPANSION = 11.7e-6
"""Thermal expansion of bearing steel, per K."""
STIFFNESS, CLEARANCE_UM = 7.6e9, 9.0
"""New and cold: contact stiffness of a ball between both races, N/m^1.5; radial clearance when mounted, um."""
SOLID, FILM = 130.0, 330.0
"""Damping that does not depend on the oil, and that of the film at 40 deg C, N s/m."""
WEAR, FRESH = 0.33, 1.7
"""Fraction of the stiffness that is lost by wear of the seat; factor of fresh oil on the film's damping."""
COOLED, WEARS, REFILLED = ((0.18, 0.3), (0.88, 0.96)), (0.35, 0.8), 0.6
"""Intervals with cooling water, begin and end of the wear, and time of fresh oil, as fractions of the run."""


@dataclass(frozen=True)
class Course:
    """State of the machine over time: measured quantities and true parameters.

    Parameters
    ----------
    time_s, temperature_c, speed_rpm, load_n : Array [states]
        Measured at each state message: thermometer in the outer ring (steps of 0.1 K), tachometer, load cell.
    stiffness, damping, clearance_um : Array [states]
        True values, N/m^1.5, N s/m, um.
    """

    time_s: Array
    temperature_c: Array
    speed_rpm: Array
    load_n: Array
    stiffness: Array
    damping: Array
    clearance_um: Array


@dataclass(frozen=True)
class Drifting:
    """Virtual machine with drifting parameters.

    Parameters
    ----------
    duration_h : float
        Length of the run, hours.
    drift : float
        Factor on the drifts. 1: as described above. 0: warm from the start, one operating point, no wear.
    state_period_s, snapshot_period_s : float
        Intervals of state messages and of vibration snapshots, s.
    snapshot_s : float
        Length of a snapshot, s.
    fs_hz : float
        Sampling rate, Hz.

    Raises
    ------
    TwingapError
        For a value outside its range.
    """

    name = "drifting"
    duration_h: float = 14.0
    drift: float = 1.0
    state_period_s: float = 60.0
    snapshot_period_s: float = 600.0
    snapshot_s: float = 1.0
    fs_hz: float = 12_000.0

    def __post_init__(self) -> None:
        limits = {
            "duration_h": (0.1, 1000.0), "drift": (0.0, 1.5), "state_period_s": (1.0, 3600.0),
            "snapshot_period_s": (10.0, 86400.0), "snapshot_s": (0.1, 60.0), "fs_hz": (9000.0, 60000.0),
        }  # fmt: skip
        for key, (low, high) in limits.items():
            if not low <= getattr(self, key) <= high:
                raise TwingapError(
                    f"{key} = {getattr(self, key):g}, between {low:g} and {high:g} expected", where=f"rig {self.name}"
                )

    def course(self, seed: int = 0) -> Course:
        """State messages and true parameters; the same for the same seed."""
        rng = Streams(seed, 0)("course")
        t = np.arange(0.0, 3600 * self.duration_h, self.state_period_s)
        part, steady = t / (3600 * self.duration_h), self.drift == 0
        speed = np.full(t.size, 1800.0) if steady else _steps(t, rng, (1600.0, 1700.0, 1800.0, 1900.0, 2000.0))
        load = np.full(t.size, 550.0) if steady else _steps(t, rng, (450.0, 500.0, 550.0, 600.0, 650.0))
        day = 0.0 if steady else 4 * np.sin(2 * np.pi * t / 86400 + rng.uniform(0, 2 * np.pi))
        cooled = self.drift * np.any([(part >= on) & (part < off) for on, off in COOLED], axis=0)
        outer, inner, measured = _temperatures(t, speed, load, AMBIENT_C + day, cooled, warm=steady)
        # The clearance depends on the temperature difference of the rings: at equal temperature all parts expand alike.
        pitch_um = 1e3 * BEARINGS["6205"].pitch_diameter_mm
        clearance = CLEARANCE_UM - 0.5 * EXPANSION * pitch_um * (inner - outer)
        grown = np.clip((part - WEARS[0]) / (WEARS[1] - WEARS[0]), 0.0, 1.0)
        stiffness = STIFFNESS * (1 - self.drift * WEAR * grown**2 * (3 - 2 * grown))
        fresh = np.where(part >= REFILLED, 1 + self.drift * (FRESH - 1), 1.0)
        damping = SOLID + FILM * fresh * (_vogel(0.5 * (inner + outer)) / _vogel(np.array(40.0))) ** 0.7
        measured = np.round(measured + 0.15 * rng.standard_normal(t.size), 1)
        return Course(t, measured, speed, load, stiffness, damping, clearance)

    def records(self, seed: int = 0) -> RecordSet:
        """Vibration snapshots, each simulated on access.

        Returns
        -------
        RecordSet
            Unit m/s^2, healthy, in order of `time_s`; with measured speed and load.
        """
        course = self.course(seed)
        every = max(1, round(self.snapshot_period_s / self.state_period_s))
        places = np.arange(every, course.time_s.size, every)
        count = round(self.snapshot_s * self.fs_hz)
        conditions = [
            Condition(
                f"{self.name}-{number:04d}", float(course.speed_rpm[at]), self.fs_hz, count, "healthy",
                float(course.load_n[at]), float(course.time_s[at]), group="machine",
                extra={"temperature_c": float(course.temperature_c[at])},
            )
            for number, at in enumerate(places)
        ]  # fmt: skip
        own = Streams(seed, 0)("machine")
        balls = 0.15 * own.standard_normal(BEARINGS["6205"].n_rollers)
        slip, tones = float(own.uniform(0.0, 0.006)), own.uniform(0, 1, 4)

        @lru_cache(maxsize=4)
        def load(place: int) -> Array:
            at = int(places[place])
            rng = Streams(seed, 1 + place)("snapshot")
            return _snapshot(course, at, count, self.fs_hz, balls, slip, tones, rng)

        return RecordSet(self.name, "m/s^2", BEARINGS["6205"], conditions, load)


def arrivals(
    time_s: Array, rng: np.random.Generator, *, delay_s: float = 20.0, late: float = 0.02, late_s: float = 1500.0,
    lost: float = 0.02, repeated: float = 0.03,
) -> tuple[Array, NDArray[np.int64]]:  # fmt: skip
    """Arrival times of messages over an unreliable connection.

    Parameters
    ----------
    time_s : Array [messages]
        Times of sending, s.
    rng : numpy.random.Generator
    delay_s : float
        Mean of the exponential delay, s; messages can overtake each other.
    late, late_s : float
        Fraction of messages that are late, and mean further delay of these, s.
    lost, repeated : float
        Fractions that never arrive, and that arrive twice.

    Returns
    -------
    Array [arrived], NDArray[int64] [arrived]
        Arrival times, ascending, and indices of the messages.
    """
    n = time_s.size
    held = rng.random(n) < late
    delay = rng.exponential(delay_s, n) + np.where(held, rng.exponential(late_s, n), 0.0)
    places = np.flatnonzero(rng.random(n) >= lost)
    twice = places[rng.random(places.size) < repeated]
    which = np.concatenate([places, twice])
    at = time_s[which] + delay[which]
    at[places.size :] += rng.exponential(2 * delay_s, twice.size)
    order = np.argsort(at, kind="stable")
    return at[order], which[order].astype(np.int64)


def _steps(t: Array, rng: np.random.Generator, levels: tuple[float, ...]) -> Array:
    """Operating point that changes every one to three hours, with a small random variation [states]."""
    values, at = np.empty(t.size), 0.0
    while at <= t[-1]:
        until = at + 3600 * rng.uniform(1.0, 3.0)
        values[(t >= at) & (t < until)] = rng.choice(levels)
        at = until
    return values * (1 + 0.001 * rng.standard_normal(t.size))


def _temperatures(
    t: Array, speed_rpm: Array, load_n: Array, ambient_c: Array | float, cooled: Array, warm: bool
) -> tuple[Array, Array, Array]:
    """Temperatures of outer ring, inner ring and thermometer, deg C [states each]: two thermal nodes and a sensor."""
    step, ambient = float(t[1] - t[0]), np.broadcast_to(ambient_c, t.shape)
    outer, inner, shown = np.empty((3, t.size))
    o, i, s = AMBIENT_C, AMBIENT_C, AMBIENT_C
    small = max(1, math.ceil(step / 20.0))
    for k in range(-round(6 * 3600 / step) if warm else 0, t.size):
        at = max(k, 0)
        for _ in range(small):
            # Palmgren's two parts of the friction torque: the film's, with (viscosity x speed)^(2/3), and the load's.
            film = float(_vogel(np.array(o))) * speed_rpm[at] / (20.0 * 1800.0)
            watts = 5.5 * speed_rpm[at] / 1800 * (film ** (2 / 3) + load_n[at] / 550)
            o += step / small * ((i - o) / 260 - (1 + 2.5 * cooled[at]) * (o - ambient[at]) / 1500)
            i += step / small * (watts / 250 - (i - o) / 200)
            s += step / small * (o - s) / 90
        if k >= 0:
            outer[k], inner[k], shown[k] = o, i, s
    return outer, inner, shown


def _vogel(temperature_c: Array) -> Array:
    """Kinematic viscosity of an ISO VG 32 oil, mm^2/s: 32 at 40, 5.4 at 100 deg C (Vogel 1921)."""
    return np.asarray(0.0677 * np.exp(836.0 / (temperature_c + 95.8)))


def _snapshot(
    course: Course, at: int, count: int, fs_hz: float, balls_um: Array, slip: float, tones: Array,
    rng: np.random.Generator,
) -> Array:  # fmt: skip
    """Acceleration of the housing during one snapshot [count], m/s^2."""
    fine_hz, bearing = OVERSAMPLING * fs_hz, BEARINGS["6205"]
    settle = round(SETTLING_S * fs_hz)
    n = OVERSAMPLING * (count + settle)
    speed, load_n = float(course.speed_rpm[at]), float(course.load_n[at])
    # Force of rough surfaces: white, stronger with speed and slightly with load.
    strength = 22.0 * (speed / 1800) * (load_n / 550) ** 0.2 * math.sqrt(fine_hz / 96000.0)
    push = strength * rng.standard_normal((2, n))
    cage = rng.uniform(0, 1) + np.arange(n) * (bearing.ftf * (1 - slip) * speed / 60 / fine_hz)
    clearance = 1e-6 * (float(course.clearance_um[at]) - balls_um)
    transmitted = np.empty(n)
    _integrator()(
        transmitted, push, cage, clearance, float(course.stiffness[at]), float(course.damping[at]), load_n, 1 / fine_hz
    )
    x = transmitted / HOUSING_KG
    # Mode of a cover plate.
    w, zeta = 2 * np.pi * 4100.0, 0.03
    b, a = signal.bilinear([0.12 * w**2], [1.0, 2 * zeta * w, w**2], fine_hz)
    x = x + signal.lfilter(b, a, x)
    taps = signal.firwin(20 * OVERSAMPLING + 1, 0.92 / OVERSAMPLING)
    x = signal.lfilter(taps, [1.0], x)[::OVERSAMPLING][settle:]
    t, shaft = np.arange(count) / fs_hz, speed / 60
    for order, (level, phase) in enumerate(zip((0.05, 0.03, 0.02, 0.01), tones, strict=True), 1):
        x = x + level * np.cos(2 * np.pi * (order * shaft * t + phase + rng.uniform()))
    return np.asarray(x + 0.05 * rng.standard_normal(count))


@lru_cache(maxsize=1)
def _integrator() -> Callable[..., None]:
    """Integration loop, compiled on first use."""
    from twingap._compiled import njit

    return njit()(_verlet)


def _verlet(
    out: Array, push: Array, cage: Array, clearance: Array, stiffness: float, damping: float, load_n: float, dt: float
) -> None:  # pragma: no cover
    """Velocity Verlet of the ring (rx, ry) in the housing (hx, hy); `out` gets the inertial force of the housing in
    y."""
    z = clearance.size
    mount = HOUSING_KG * (2.0 * math.pi * HOUSING_HZ) ** 2
    loss = 2.0 * HOUSING_ZETA * HOUSING_KG * 2.0 * math.pi * HOUSING_HZ
    c0 = np.cos(2.0 * math.pi * np.arange(z) / z)
    s0 = np.sin(2.0 * math.pi * np.arange(z) / z)
    rx, ry, hx, hy = 0.0, 1e-5 + load_n / mount, 0.0, load_n / mount
    vx, vy, ux, uy = 0.0, 0.0, 0.0, 0.0
    ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
    for i in range(out.size):
        rx += dt * vx + 0.5 * dt * dt * ax
        ry += dt * vy + 0.5 * dt * dt * ay
        hx += dt * ux + 0.5 * dt * dt * bx
        hy += dt * uy + 0.5 * dt * dt * by
        # Damping uses velocities at the half step; the error is of second order, as that of the scheme.
        vx += 0.5 * dt * ax
        vy += 0.5 * dt * ay
        ux += 0.5 * dt * bx
        uy += 0.5 * dt * by
        c, s = math.cos(2.0 * math.pi * cage[i]), math.sin(2.0 * math.pi * cage[i])
        fx, fy = damping * (vx - ux), damping * (vy - uy)
        for j in range(z):
            cj, sj = c * c0[j] - s * s0[j], s * c0[j] + c * s0[j]
            d = (rx - hx) * cj + (ry - hy) * sj - clearance[j]
            if d > 0.0:
                q = stiffness * d * math.sqrt(d)
                fx += q * cj
                fy += q * sj
        ax, ay = (push[0, i] - fx) / RING_KG, (load_n + push[1, i] - fy) / RING_KG
        bx = (fx - mount * hx - loss * ux) / HOUSING_KG
        by = (fy - mount * hy - loss * uy) / HOUSING_KG
        out[i] = HOUSING_KG * by
        vx += 0.5 * dt * ax
        vy += 0.5 * dt * ay
        ux += 0.5 * dt * bx
        uy += 0.5 * dt * by
