"""Displacement and velocity of the contact model: against static Hertz solutions, energy and SciPy's integrator."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

from papers.paper2_digital_twin.dynamics.contact_motion import motion_of
from twingap.bearing import BEARINGS
from twingap.records import Condition
from twingap.twins.contact_dynamics import Job, low_pass
from twingap.twins.contact_integration import integrate
from twingap.twins.contact_kernel import LANES
from twingap.twins.contact_parameters import ContactParameters

Array = NDArray[np.float64]
BEARING = BEARINGS["6205"]
FS_HZ, SPEED_RPM = 20000.0, 1797.0
QUIET = ContactParameters(structure_noise_rms=0.0, white_noise_rms=0.0)
TIGHT = replace(QUIET, clearance_um=-4.0)


def job(
    own: ContactParameters, samples: int, fault: str = "healthy", *, cage: float = 0.0, turning: bool = True
) -> Job:
    turns = np.arange(samples) / FS_HZ * (SPEED_RPM / 60 if turning else 0.0)
    return Job(BEARING, own, Condition("motion", SPEED_RPM, FS_HZ, samples, fault), turns, starts=(0.0, cage, 0.0))


def contact_forces(own: ContactParameters, x: float, y: float, cage: float) -> tuple[Array, Array, Array]:
    """Compression of each roller and its direction, from the formula in the papers, written anew."""
    angle = 2 * math.pi * (cage + np.arange(BEARING.n_rollers) / BEARING.n_rollers)
    c, s = np.cos(angle), np.sin(angle)
    return np.maximum(x * c + y * s - 1e-6 * own.clearance_um, 0.0), c, s


def rest(own: ContactParameters, cage: float) -> Array:
    """Static equilibrium by SciPy's root finder, in um."""

    def residual(at: Array) -> list[float]:
        delta, c, s = contact_forces(own, 1e-6 * at[0], 1e-6 * at[1], cage)
        q = own.stiffness * delta**own.exponent
        return [float(q @ c) - own.load_x_n, float(q @ s) - own.load_n]

    found = root(residual, [0.0, own.clearance_um + 10.0], tol=1e-13)
    assert found.success
    return np.asarray(found.x)


def energy(own: ContactParameters, state: Array, cage: Array) -> Array:
    """Kinetic and elastic energy, less the load's work, J [samples]."""
    out = []
    for (x, y, vx, vy), at in zip(state.T, cage, strict=True):
        delta, _, _ = contact_forces(own, x, y, at)
        elastic = own.stiffness / (own.exponent + 1) * float((delta ** (own.exponent + 1)).sum())
        out.append(0.5 * own.mass_kg * (vx**2 + vy**2) + elastic - own.load_n * y - own.load_x_n * x)
    return np.array(out)


def test_seen_sample_by_sample_it_is_the_same_trajectory_to_the_bit() -> None:
    one = job(QUIET, 60, "outer", cage=0.23)
    motion = motion_of(one, steps=8)
    turns, cage = one.turns + one.starts[0], one.bearing.ftf * one.turns + one.starts[1]
    state = np.zeros((1, 4, LANES))
    rows = np.tile(np.array(one.rows(8))[None, :, None], (1, 1, LANES))
    integrate(
        9, state, np.tile(turns[None, :, None], (1, 1, LANES)), np.tile(cage[None, :, None], (1, 1, LANES)), rows,
        *low_pass(8), np.empty((1, 60 - 35, LANES)),
    )  # fmt: skip
    seen = motion.state[:, -1]
    np.testing.assert_array_equal(seen, state[0, :, 0])
    assert seen.any()


@pytest.mark.parametrize("contact", ["point", "line"])
@pytest.mark.parametrize(("cage", "clearance", "load_x"), [(0.0, 5.0, 0.0), (0.04, 5.0, 120.0), (0.09, -3.0, -60.0)])
def test_a_standing_bearing_settles_where_the_static_hertz_equations_say(
    contact: Literal["point", "line"], cage: float, clearance: float, load_x: float
) -> None:
    own = replace(QUIET, contact=contact, clearance_um=clearance, load_x_n=load_x, damping=2500.0)
    if contact == "line":
        own = replace(own, stiffness=2e8)
    motion = motion_of(job(own, 1600, cage=cage, turning=False))
    np.testing.assert_allclose(
        [1e6 * motion.state[0, -1], 1e6 * motion.state[1, -1]], rest(own, cage), rtol=1e-6, atol=1e-6
    )  # fmt: skip
    assert abs(motion.state[2, -1]) + abs(motion.state[3, -1]) < 1e-8


def test_stribeck_load_of_the_lowest_roller_without_clearance() -> None:
    """4.37 F / Z, Stribeck's number for balls without clearance (Harris, Rolling Bearing Analysis)."""
    own = replace(QUIET, clearance_um=0.0, damping=2500.0)
    motion = motion_of(job(own, 1600, cage=0.25, turning=False))  # a roller straight under the load
    delta, _, _ = contact_forces(own, motion.state[0, -1], motion.state[1, -1], 0.25)
    assert own.stiffness * delta.max() ** 1.5 == pytest.approx(4.37 * own.load_n / 9, rel=0.02)


def test_without_damping_energy_stays_and_the_error_falls_with_the_fourth_power_of_the_step_or_faster() -> None:
    own = replace(TIGHT, damping=0.0)
    lost = []
    for steps in (2, 4):
        motion = motion_of(job(own, 400, turning=False, cage=0.03), steps=steps)
        state = motion.state
        total = energy(own, state, motion.cage_turns)
        swing = 0.5 * own.mass_kg * float((motion.state[2] ** 2 + motion.state[3] ** 2).max())
        lost.append(float(np.abs(total - total[0]).max()) / swing)
    assert lost[0] < 0.02 and lost[0] > 14 * lost[1]


def test_energy_lost_is_what_damping_takes_and_energy_gained_what_the_cage_brings() -> None:
    motion = motion_of(job(TIGHT, 3000, cage=0.03), steps=8)
    state = motion.state
    total = energy(TIGHT, state, motion.cage_turns)
    taken = TIGHT.damping * (motion.state[2] ** 2 + motion.state[3] ** 2)
    rate = 2 * math.pi * BEARING.ftf * SPEED_RPM / 60
    brought = []
    for x, y, at in zip(motion.state[0], motion.state[1], motion.cage_turns, strict=True):
        delta, c, s = contact_forces(TIGHT, x, y, at)
        brought.append(float(TIGHT.stiffness * (delta**1.5) @ (-x * s + y * c)) * rate)
    step = 0.5 / FS_HZ
    work = np.concatenate(
        [[0.0], np.cumsum(step * ((np.array(brought) - taken)[1:] + (np.array(brought) - taken)[:-1]))]
    )
    moved = float(np.abs(total - total[0]).max())
    assert np.abs(total - total[0] - work).max() < 5e-3 * moved  # the trapezoidal rule's own error
    # Settled: over whole roller passes as much is brought as taken, and the ring is where the static solution is.
    late = slice(1500, None)
    still = [rest(TIGHT, at) for at in motion.cage_turns[late][::100]]
    np.testing.assert_allclose(1e6 * motion.state[1, late][::100], [v[1] for v in still], atol=0.02)


@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_scipy_gets_the_same_motion_from_equations_written_anew(fault: str) -> None:
    samples, own = 240, replace(QUIET, damping=900.0)
    one = job(own, samples, fault, cage=0.22)
    motion = motion_of(one, steps=32)
    passes = BEARING.n_rollers * 90 / 360

    def depth(cage: float) -> Array:
        """How far each roller has sunk into a pit at 90 degrees, whose edge is a quintic over half its width."""
        distance = np.abs((BEARING.n_rollers * cage - passes + np.arange(9) + 4.5) % 9 - 4.5) / one.half_width
        s = np.clip(1 - distance, 0.0, 1.0)
        return np.asarray(one.depth_m * s**3 * (10 - 15 * s + 6 * s**2))

    def slope(t: float, state: Array) -> list[float]:
        x, y, vx, vy = state
        cage = 0.22 + BEARING.ftf * SPEED_RPM / 60 * t
        angle = 2 * math.pi * (cage + np.arange(9) / 9)
        c, s = np.cos(angle), np.sin(angle)
        q = own.stiffness * np.maximum(x * c + y * s - 1e-6 * own.clearance_um - depth(cage), 0.0) ** 1.5
        ax, ay = own.load_x_n - own.damping * vx - q @ c, own.load_n - own.damping * vy - q @ s
        return [vx, vy, float(ax) / own.mass_kg, float(ay) / own.mass_kg]

    end = (samples - 1) / FS_HZ
    theirs = solve_ivp(slope, (0, end), np.zeros(4), "DOP853", rtol=1e-10, atol=1e-13, t_eval=motion.t_s, max_step=2e-5)
    scale = np.abs(theirs.y).max(axis=1)
    ours = motion.state
    assert (np.abs(ours - theirs.y).max(axis=1) < 1e-4 * scale).all()
