"""Trajectories of the contact model for records: static equilibrium, internal step, groups of jobs.

Jobs (bearing, parameters, condition, angles) --> equilibrium, oversampling --> groups of similar jobs --> kernel
                                                                                 --> acceleration in y, per job
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin

from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.twins.base import GPU_SAMPLES
from twingap.twins.contact_parameters import ContactParameters

Array = NDArray[np.float64]

STEP_ANGLE: Final = 0.25
"""Largest angle (rad) by which the fastest contact mode may turn in an internal step. RK4 is stable up to 2.8; at 0.25
it loses less than 2e-6 of the amplitude and 1e-5 rad of phase per step."""

STEPS_PER_EDGE: Final = 6
"""Fewest internal steps within a smooth edge."""

UNSTABLE_ANGLE: Final = 1.0
"""Largest angle per step, rad, that an `oversampling` stated by the user may give."""

LADDER: Final = tuple(sorted({a * 2**b for a in (4, 5, 6, 7) for b in range(1, 9)} | {2, 4, 6}))
"""Oversampling factors: few, so that records can share vector groups, and at most a quarter too fine."""

SETTLED: Final = 7.0
"""Decay times of the contact mode between the equilibrium and a record's start: exp(-7) of a deviation remains."""

SETTLING_S: Final = (0.03, 0.5)
"""Shortest and longest settling time, s."""

CAGE_POSITIONS: Final = 12
"""Positions of the cage, evenly over a roller pitch, over which the equilibrium is averaged."""


@dataclass(frozen=True)
class Statics:
    """Parameters of the equilibrium, in SI units (stiffness in N/m^exponent)."""

    stiffness: float
    exponent: float
    mass_kg: float
    clearance_m: float
    force_x: float
    force_y: float


@dataclass(frozen=True)
class Equilibrium:
    """Static equilibrium of the ring, linearised; means over the positions of the rollers.

    Parameters
    ----------
    x, y : float
        Displacement, m.
    squeeze : float
        Largest compression of a roller, m.
    w_y : float
        Natural frequency in the load's direction, rad/s.
    w_max : float
        Highest natural frequency in any direction and at any position, rad/s.
    """

    x: float
    y: float
    squeeze: float
    w_y: float
    w_max: float


@lru_cache(maxsize=1024)
def equilibrium(bearing: Bearing, own: Statics) -> Equilibrium:
    """Static equilibrium, averaged over the positions of the rollers.

    Without load the ring has no stiffness within its clearance; it is then linearised under its own weight.
    """
    cage = np.arange(CAGE_POSITIONS) / (CAGE_POSITIONS * bearing.n_rollers)
    xy, stiffness, squeeze = settle(bearing.n_rollers, own, cage)
    w = np.sqrt(np.linalg.eigvalsh(stiffness)[:, -1] / own.mass_kg)
    w_y = math.sqrt(float(stiffness[:, 1, 1].mean()) / own.mass_kg)
    return Equilibrium(float(xy[:, 0].mean()), float(xy[:, 1].mean()), float(squeeze.max()), w_y, float(w.max()))


def statics(own: ContactParameters, load_n: float | None) -> Statics:
    """Static problem of a record with this load (None: that of the parameters)."""
    load = own.load_n if load_n is None else load_n
    if math.hypot(load, own.load_x_n) < own.mass_kg * 9.81:
        load = own.mass_kg * 9.81
    return Statics(own.stiffness, own.exponent, own.mass_kg, 1e-6 * own.clearance_um, own.load_x_n, load)


def settle(n_rollers: int, own: Statics, cage: Array) -> tuple[Array, Array, Array]:
    """Static position of the ring for each cage angle.

    The energy of the contacts is convex, so Newton's method with a line search converges from any start; it starts in
    the direction of the load, with the squeeze of the usual load distribution.

    Parameters
    ----------
    n_rollers : int
    own : Statics
    cage : Array [positions]
        Angle of the cage, turns.

    Returns
    -------
    Array [positions, 2], Array [positions, 2, 2], Array [positions]
        Displacement (m), stiffness (N/m), compression of the most loaded roller (m).

    Raises
    ------
    TwingapError
        When none is found, for values that no bearing has.
    """
    angles = 2 * np.pi * (cage[:, None] + np.arange(n_rollers) / n_rollers)
    e = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    force = np.array([own.force_x, own.force_y])
    size, n = float(np.hypot(*force)), own.exponent
    guess = (5 * size / (n_rollers * own.stiffness)) ** (1 / n)
    # Far enough to squeeze a roller even where the load is between two of them.
    xy = np.tile(force / size * (max(own.clearance_m, 0.0) + guess) / math.cos(math.pi / n_rollers), (cage.size, 1))
    typical = n * own.stiffness * guess ** (n - 1)

    def squeezed(at: Array) -> Array:
        return np.maximum((e @ at[:, :, None])[:, :, 0] - own.clearance_m, 0.0)

    def energy(at: Array) -> Array:
        potential: Array = own.stiffness / (n + 1) * (squeezed(at) ** (n + 1)).sum(axis=1) - at @ force
        return potential

    for _ in range(100):
        delta = squeezed(xy)
        residual = own.stiffness * np.einsum("pj,pjk->pk", delta**n, e) - force
        slope = np.where(delta > 0, n * own.stiffness * np.maximum(delta, 1e-300) ** (n - 1), 0.0)
        hessian = np.einsum("pj,pjk,pjl->pkl", slope, e, e)
        if np.abs(residual).max() <= 1e-11 * size:
            break
        # A ring on one roller has no transverse stiffness, and one out of contact none: a small stiffness keeps the
        # step finite, and the line search shortens it.
        step = -np.linalg.solve(hessian + 1e-9 * typical * np.eye(2), residual[:, :, None])[:, :, 0]
        before, length = energy(xy), np.ones(cage.size)
        for _ in range(60):
            worse = energy(xy + length[:, None] * step) > before + 1e-14 * np.abs(before)
            if not worse.any():
                break
            length = np.where(worse, length / 2, length)
        xy = xy + length[:, None] * step
    if not np.abs(residual).max() <= 1e-6 * size:
        raise TwingapError(
            f"no static equilibrium found under {size:g} N",
            where="contact parameters",
            mend="bring stiffness, load and clearance_um into their plausible range",
        )
    return xy, hessian, squeezed(xy).max(axis=1)


@dataclass(frozen=True)
class Job:
    """Trajectory to integrate.

    Parameters
    ----------
    bearing, parameters, condition
        Of its record.
    turns : Array [samples]
        Shaft angle since the record's start, turns.
    cage_speed_ratio : float
        Cage speed over its kinematic value.
    cage_lag : Array [samples] or None
        Delay of the roller train, in shaft turns.
    starts : (float, float, float)
        Angles of shaft, cage and (for a ball defect) the ball's spin at the record's start, turns.
    """

    bearing: Bearing
    parameters: ContactParameters
    condition: Condition
    turns: Array
    cage_speed_ratio: float = 1.0
    cage_lag: Array | None = None
    starts: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def equilibrium(self) -> Equilibrium:
        """Static equilibrium of the ring."""
        return equilibrium(self.bearing, statics(self.parameters, self.condition.load_n))

    @property
    def depth_m(self) -> float:
        """Depth of this record's defect, m; 0 when healthy."""
        return 1e-6 * self.parameters.defect_depth_um.get(self.condition.fault or "", 0.0)

    @property
    def half_width(self) -> float:
        """Half the defect's width, in passes of a roller (for a ball: in half spins).

        Raises
        ------
        TwingapError
            When two rollers could be in the defect at once.
        """
        own, bearing = self.parameters, self.bearing
        across = bearing.ratio * bearing.pitch_diameter_mm
        raceway = {
            "outer": math.pi * (bearing.pitch_diameter_mm + across) / bearing.n_rollers,
            "inner": math.pi * (bearing.pitch_diameter_mm - across) / bearing.n_rollers,
            "ball": math.pi * bearing.roller_diameter_mm / 2,
        }
        half = 0.5 * own.defect_width_mm / raceway.get(self.condition.fault or "", raceway["inner"])
        if half > 0.5:
            raise TwingapError(
                f"defect_width_mm = {own.defect_width_mm:g} is wider than the distance between two rollers",
                where="contact parameters",
                mend=f"at most {own.defect_width_mm * 0.5 / half:.3g} mm for {bearing.name!r}",
            )  # fmt: skip
        return half

    def oversampling(self) -> int:
        """Internal steps per sample.

        The smallest of `LADDER` with which the fastest contact mode turns by at most `STEP_ANGLE` per step (its
        stiffness taken at twice the static squeeze plus the defect's depth, the rebound after a drop),
        damping acts over as many, and a smooth edge lasts at least `STEPS_PER_EDGE`.

        Raises
        ------
        TwingapError
            When none of them suffices, or the one stated by the user is unstable.
        """
        own, rest = self.parameters, self.equilibrium
        dt, where = 1 / self.condition.fs_hz, f"record {self.condition.name!r}, contact twin"
        stiffer = 2 + self.depth_m / rest.squeeze
        turning = max(rest.w_max * stiffer ** (0.5 * (own.exponent - 1)), own.damping / own.mass_kg)
        needed = turning * dt / STEP_ANGLE
        if own.oversampling is not None:
            if turning * dt / own.oversampling > UNSTABLE_ANGLE:
                raise TwingapError(
                    f"oversampling = {own.oversampling} is unstable with a contact mode of "
                    f"{turning / (2 * math.pi):.0f} Hz",
                    where=where, mend=f"use at least {math.ceil(needed)}, or leave it out",
                )  # fmt: skip
            return own.oversampling
        if own.edge > 0 and self.depth_m > 0:
            passes_per_s = self.bearing.fault_order(self.condition.fault or "") * self.condition.speed_rpm / 60
            needed = max(needed, STEPS_PER_EDGE * dt * passes_per_s / (own.edge * self.half_width))
        for factor in LADDER:
            if factor >= needed:
                return factor
        raise TwingapError(
            f"this contact needs {needed:.3g} internal steps per sample, more than {LADDER[-1]}",
            where=where, mend="lower stiffness or speed, raise mass_kg or fs_hz, or widen the defect",
        )  # fmt: skip

    def settling(self) -> int:
        """Samples between the equilibrium and the record's start."""
        shortest, longest = SETTLING_S
        decay = self.parameters.damping / (2 * self.parameters.mass_kg)
        return math.ceil(min(max(SETTLED / max(decay, 1e-9), shortest), longest) * self.condition.fs_hz)

    def rows(self, oversampling: int) -> list[float]:
        """This lane's parameters, in the order of `contact_kernel.ROWS`."""
        own, z, mass = self.parameters, self.bearing.n_rollers, self.parameters.mass_kg
        load = own.load_n if self.condition.load_n is None else self.condition.load_n
        spin = 2 * self.bearing.bsf / (1 - self.bearing.ftf)
        phase = {
            "outer": (0.0, -z, z * own.outer_angle_deg / 360, 1.0),
            "inner": (z, -z, 0.0, 1.0),
            "ball": (spin, -spin, 2 * self.starts[2] - spin * (self.starts[0] - self.starts[1]), 0.0),
        }.get(self.condition.fault or "", (0.0, 0.0, 0.0, 0.0))
        return [
            0.5 / (self.condition.fs_hz * oversampling), own.stiffness / mass, own.damping / mass,
            1e-6 * own.clearance_um, own.load_x_n / mass, load / mass, 1e-6 * own.eccentricity_um * 4 * math.pi**2,
            self.depth_m, 1e300 if own.edge == 0 else 1 / own.edge, 1 / self.half_width, *phase,
        ]  # fmt: skip

    def angles(self, before: int, points: int) -> tuple[Array, Array]:
        """Shaft and cage angle (turns) at `points` samples, the first `before` samples ahead of the record.

        Outside the record the shaft has its mean speed and the delay of the roller train is constant.
        """
        per_sample = self.condition.speed_rpm / (60 * self.condition.fs_hz)
        after = points - before - self.turns.size
        turns = np.pad(self.turns, (before, after), mode="edge")
        turns[:before] -= per_sample * np.arange(before, 0, -1)
        turns[points - after :] += per_sample * np.arange(1, after + 1)
        late = 0.0 if self.cage_lag is None else np.pad(self.cage_lag, (before, after), mode="edge")
        cage = self.bearing.ftf * self.cage_speed_ratio * (turns - late)
        return turns + self.starts[0], cage + self.starts[1]


def accelerations(jobs: Sequence[Job], device: str = "cpu") -> list[tuple[Array, int]]:
    """Accelerations of jobs, integrated in groups of sixteen of the same kind, on the CPU or a GPU ("cuda").

    Returns
    -------
    list of (Array [lead + samples], int)
        For each job its acceleration in y (m/s^2) at the record's rate, with `lead` samples from before the record.

    Raises
    ------
    TwingapError
        When a trajectory leaves the range of numbers.
    """
    kinds: dict[tuple[int, int, str], list[int]] = {}
    for place, job in enumerate(jobs):
        kind = (job.oversampling(), job.bearing.n_rollers, job.parameters.contact)
        kinds.setdefault(kind, []).append(place)
    done: dict[int, tuple[Array, int]] = {}
    for (factor, n_rollers, contact), places in kinds.items():
        done |= _of_a_kind(jobs, places, factor, n_rollers, contact == "point", device)
    return [done[place] for place in range(len(jobs))]


def _of_a_kind(
    jobs: Sequence[Job], places: list[int], factor: int, n_rollers: int, point_contact: bool, device: str
) -> dict[int, tuple[Array, int]]:
    """Integrate jobs with the same step and bearing; unused lanes repeat the last job."""
    # Compiled code, imported on use.
    from twingap.twins.contact_integration import integrate
    from twingap.twins.contact_kernel import LANES, LOOK_AHEAD, LOOK_BACK, ROWS

    first, second = low_pass(factor)
    leads = {place: LOOK_BACK + jobs[place].settling() for place in places}
    intervals = {place: leads[place] + jobs[place].condition.n_samples - 1 + LOOK_AHEAD for place in places}
    ordered = sorted(places, key=lambda place: intervals[place])
    if device == "cuda" and len(ordered) > LANES and len(ordered) * intervals[ordered[-1]] > 2 * GPU_SAMPLES:
        # All are integrated in arrays as long as the longest: halves of similar length bound the memory.
        half = len(ordered) // 2
        parts = (
            _of_a_kind(jobs, part, factor, n_rollers, point_contact, device)
            for part in (ordered[:half], ordered[half:])
        )
        return {place: made for part in parts for place, made in part.items()}
    ordered += [ordered[-1]] * (-len(ordered) % LANES)
    lanes = [ordered[at : at + LANES] for at in range(0, len(ordered), LANES)]
    lengths = np.array([max(intervals[place] for place in group) for group in lanes])
    points = int(lengths.max()) + 1
    turns, cage = np.empty((2, len(lanes), points, LANES))
    state, rows = np.zeros((len(lanes), 4, LANES)), np.empty((len(lanes), len(ROWS), LANES))
    for g, group in enumerate(lanes):
        for lane, place in enumerate(group):
            job = jobs[place]
            turns[g, :, lane], cage[g, :, lane] = job.angles(leads[place], points)
            rows[g, :, lane] = job.rows(factor)
            state[g, :2, lane] = job.equilibrium.x, job.equilibrium.y
    output = np.empty((len(lanes), points - LOOK_BACK - LOOK_AHEAD, LANES))
    integrate(
        n_rollers, state, turns, cage, rows, first, second, output,
        lengths=lengths, point_contact=point_contact, device=device,
    )  # fmt: skip
    done: dict[int, tuple[Array, int]] = {}
    for g, group in enumerate(lanes):
        for lane, place in enumerate(group):
            lead = leads[place] - LOOK_BACK
            kept = output[g, : lead + jobs[place].condition.n_samples, lane].copy()
            if not np.isfinite(kept).all():
                raise TwingapError(
                    "the contact's motion leaves the range of numbers",
                    where=f"record {jobs[place].condition.name!r}, contact twin",
                    mend="leave oversampling out, or bring stiffness, load and mass_kg into their plausible range",
                )
            done[place] = (kept, lead)
    return done


@lru_cache(maxsize=64)
def low_pass(factor: int) -> tuple[Array, Array]:
    """Weights of the decimation by `factor`, in two stages.

    Both are symmetric windowed sincs: no delay, flat to 0.4 fs (0.5 %), attenuation of 49 dB from 0.5 fs, as of a
    measuring card. Without them, vibration above the band would be aliased. The first stage protects only the band
    below fs / 2 and is short; the second, at 2 fs, is steep.

    Returns
    -------
    Array [6, factor / 2], Array [64]
        As `contact_integration.integrate` wants them.
    """
    steps = factor // 2
    if steps == 1:
        short = np.eye(6)[3]
    else:
        short = firwin(6 * steps + 1, 1.0, window=("kaiser", 4.5), fs=factor)[:-1]
        short[0] = 0.0  # its counterpart is in the next half sample
    steep = firwin(65, 0.45, window=("kaiser", 5.0), fs=2.0)[:-1]
    steep[0] = 0.0
    # Times are ascending; the first row of the kernel is the latest half sample.
    return np.ascontiguousarray((short / short.sum()).reshape(6, steps)[::-1]), steep / steep.sum()
