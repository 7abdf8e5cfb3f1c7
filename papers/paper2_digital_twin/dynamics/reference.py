"""Reference implementation of the contact model: static Hertz solution, and integration by SciPy.

Shares no line with the twin's kernel, so that agreement says something. The healthy bearing alone: what figure 6 of the
paper took from its reference [32].
"""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from papers.arrays import Array
from twingap import Bearing, TwingapError
from twingap.twins.contact_parameters import ContactParameters


def squeeze(bearing: Bearing, own: ContactParameters, x: float, y: float, cage: float) -> tuple[Array, Array, Array]:
    """Compression of each roller (m), cosine and sine of its angle [rollers]."""
    angle = 2 * math.pi * (cage + np.arange(bearing.n_rollers) / bearing.n_rollers)
    c, s = np.cos(angle), np.sin(angle)
    return np.maximum(x * c + y * s - 1e-6 * own.clearance_um, 0.0), c, s


def rest(bearing: Bearing, own: ContactParameters, load_n: float, cage: float) -> tuple[float, float]:
    """Where the ring rests under its load, m: the root of sum K delta^n e = F, by Powell's hybrid method."""

    def residual(at: Array) -> list[float]:
        delta, c, s = squeeze(bearing, own, 1e-6 * at[0], 1e-6 * at[1], cage)
        q = own.stiffness * delta**own.exponent
        return [float(q @ c) - own.load_x_n, float(q @ s) - load_n]

    deep = 1e6 * (5 * load_n / (bearing.n_rollers * own.stiffness)) ** (1 / own.exponent)
    found = root(residual, [0.0, max(own.clearance_um, 0.0) + deep], tol=1e-12)
    if np.abs(residual(found.x)).max() > 1e-6 * max(load_n, 1.0):
        raise TwingapError(f"no static equilibrium under {load_n:g} N", where="reference")
    return float(1e-6 * found.x[0]), float(1e-6 * found.x[1])


def energy(
    bearing: Bearing, own: ContactParameters, load_n: float, state: Array, cage: Array, cage_hz: float
) -> tuple[Array, Array]:
    """Energy of the ring (kinetic, elastic, less the load's work), J, and the power that the cage brings in and damping
    takes out, W [samples]: dE/dt = P, exactly. `state` is [4, samples]; `cage` its angle, turns."""
    total, power = np.empty(cage.size), np.empty(cage.size)
    for i, (x, y, vx, vy) in enumerate(state.T):
        delta, c, s = squeeze(bearing, own, x, y, float(cage[i]))
        elastic = own.stiffness / (own.exponent + 1) * float((delta ** (own.exponent + 1)).sum())
        total[i] = 0.5 * own.mass_kg * (vx**2 + vy**2) + elastic - load_n * y - own.load_x_n * x
        carried = own.stiffness * float(delta**own.exponent @ (y * c - x * s)) * 2 * math.pi * cage_hz
        power[i] = carried - own.damping * (vx**2 + vy**2)
    return total, power


def integrated(bearing: Bearing, own: ContactParameters, load_n: float, t_s: Array, cage_hz: float) -> Array:
    """A healthy bearing from rest at the centre, by SciPy's DOP853 [4, samples]: x, y (m), vx, vy (m/s)."""

    def slope(t: float, state: Array) -> list[float]:
        x, y, vx, vy = (float(v) for v in state)
        delta, c, s = squeeze(bearing, own, x, y, cage_hz * t)
        q = own.stiffness * delta**own.exponent
        ax = (own.load_x_n - own.damping * vx - float(q @ c)) / own.mass_kg
        return [vx, vy, ax, (load_n - own.damping * vy - float(q @ s)) / own.mass_kg]

    done = solve_ivp(
        slope, (0.0, float(t_s[-1])), np.zeros(4), "DOP853", t_eval=t_s, rtol=1e-9, atol=1e-13, max_step=5e-5
    )  # fmt: skip
    return np.asarray(done.y)
