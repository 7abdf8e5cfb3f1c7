"""The contact model written for JAX, diffrax and SciPy: the same equations, step and precision, each in its own idiom.

They get the kernel's algebra (the cage's frame, one sine and cosine per evaluation, one defect at a time), and less to
do: no filter and no output but the last state.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from twingap.twins.contact_dynamics import Job

Array = NDArray[np.float64]


def absent(*packages: str) -> list[str]:
    """Which of these packages are not installed."""
    return [package for package in packages if importlib.util.find_spec(package) is None]


def equations(job: Job, np_like: Any = np) -> Callable[[Any, Any, Any], Any]:
    """slope(t, state, (shaft, cage)) of [x, y, vx, vy] for an outer-race fault at constant speed, angles in turns."""
    own, z = job.parameters, job.bearing.n_rollers
    along, across = (np_like.asarray(f(2 * np.pi * np.arange(z) / z)) for f in (np.cos, np.sin))
    rollers = np_like.arange(z)
    hz, ftf = job.condition.speed_rpm / 60, job.bearing.ftf
    stiffness, damping, mass = own.stiffness / own.mass_kg, own.damping / own.mass_kg, own.mass_kg
    clearance, depth, half, at = 1e-6 * own.clearance_um, job.depth_m, job.half_width, own.outer_angle_deg / 360
    force_x, force_y = own.load_x_n / mass, own.load_n / mass

    def slope(t: Any, state: Any, starts: Any) -> Any:
        x, y, vx, vy = state[0], state[1], state[2], state[3]
        cage = starts[1] + ftf * hz * t
        c, s = np_like.cos(2 * math.pi * cage), np_like.sin(2 * math.pi * cage)
        p = z * (at - cage)
        n = np_like.floor(p + 0.5)
        inside = np_like.clip(1 - np_like.abs(p - n) / half, 0.0, 1.0)
        dip = depth * inside**3 * (10 + inside * (6 * inside - 15))
        sunk = np_like.where(rollers == n % z, dip, 0.0)
        squeeze = np_like.maximum((x * c + y * s) * along + (y * c - x * s) * across - clearance - sunk, 0.0)
        q = squeeze * np_like.sqrt(squeeze)
        px, py = (q * along).sum(), (q * across).sum()
        return np_like.stack(
            [
                vx,
                vy,
                force_x - damping * vx - stiffness * (px * c - py * s),
                force_y - damping * vy - stiffness * (px * s + py * c),
            ]
        )

    return slope


def with_jax(job: Job, starts: Array, first: Array, dt: float, steps: int, device: str = "cpu") -> Callable[[], Array]:
    """Classical RK4, jitted and vmapped over trajectories [trajectories, 2] from states [trajectories, 4]."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    slope = equations(job, jnp)

    def one(state: Any, begin: Any) -> Any:
        def step(i: Any, s: Any) -> Any:
            t = i * dt
            a = slope(t, s, begin)
            b = slope(t + dt / 2, s + dt / 2 * a, begin)
            c = slope(t + dt / 2, s + dt / 2 * b, begin)
            d = slope(t + dt, s + dt * c, begin)
            return s + dt / 6 * (a + 2 * (b + c) + d)

        return jax.lax.fori_loop(0, steps, step, state)

    run = jax.jit(jax.vmap(one))
    states, begins = jax.device_put((first, starts), jax.devices(device)[0])
    return lambda: np.asarray(run(states, begins))


def with_diffrax(
    job: Job, starts: Array, first: Array, dt: float, steps: int, device: str = "cpu"
) -> Callable[[], Array]:
    """The same through diffrax, whose solvers take any tableau: here that of classical RK4, with constant steps."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    slope = equations(job, jnp)

    class RK4(diffrax.AbstractERK):  # type: ignore[misc]
        tableau = diffrax.ButcherTableau(
            c=np.array([0.5, 0.5, 1.0]),
            b_sol=np.array([1, 2, 2, 1]) / 6,
            b_error=np.array([1, 0, 0, -1]) / 6,
            a_lower=(np.array([0.5]), np.array([0.0, 0.5]), np.array([0.0, 0.0, 1.0])),
        )
        interpolation_cls = diffrax.ThirdOrderHermitePolynomialInterpolation.from_k

        def order(self, terms: Any) -> int:
            return 4

    def one(state: Any, begin: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(slope), RK4(), 0.0, steps * dt, dt, state, begin, max_steps=None, throw=False,
            saveat=diffrax.SaveAt(t1=True), adjoint=diffrax.ForwardMode(),
        ).ys[0]  # fmt: skip

    run = jax.jit(jax.vmap(one))
    states, begins = jax.device_put((first, starts), jax.devices(device)[0])
    return lambda: np.asarray(run(states, begins))


def with_scipy(
    job: Job, starts: Array, first: Array, seconds: float, method: Any, rtol: float, max_step: float = np.inf
) -> Array:
    """`solve_ivp` on one trajectory: its state after `seconds`."""
    slope = equations(job)
    done = solve_ivp(
        lambda t, state: slope(t, state, starts), (0.0, seconds), first, method, [seconds],
        rtol=rtol, atol=rtol * 1e-9, max_step=max_step,
    )  # fmt: skip
    return np.asarray(done.y[:, -1])
