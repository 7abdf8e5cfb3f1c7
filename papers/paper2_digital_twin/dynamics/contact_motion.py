"""Motion in the contact model: displacement and velocity of the inner ring.

Jobs (bearing, parameters, condition, angles), start --> kernel, one sample at a time --> x, y, vx, vy at every sample

The kernel of `contact_kernel` hands back a trajectory's state where a call ends. Here every call lasts one sample, so
that each state is seen; the trajectory is that of one long call, to the bit, because the kernel anchors its recurrences
anew at every sample. Figures 5 and 6 of paper 2 (a normal bearing settling to balance) are of these quantities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError
from twingap.twins.contact_dynamics import Job, low_pass

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Where the inner ring's centre is, and how fast it moves."""

    t_s: Array  # [samples] time since the start, s
    x_m: Array  # x_m, y_m: [samples] displacement across and along the load, m
    y_m: Array
    vx_m_s: Array  # vx_m_s, vy_m_s: [samples] velocity, m/s
    vy_m_s: Array
    cage_turns: Array  # [samples] angle of the cage: roller j stands at 2 pi (cage_turns + j / Z)


def motions(jobs: Sequence[Job], start: ArrayLike = (0.0, 0.0, 0.0, 0.0), *, steps: int | None = None) -> list[Motion]:
    """Integrate jobs from a given state, classical RK4 with a fixed step ("ode4"), and keep every sample's state.

    Raises `TwingapError` when jobs differ in what they must share, or a trajectory leaves the range of numbers.

    Parameters
    ----------
    jobs : sequence of Job
        Of one bearing type, one kind of contact and as many samples each; a job's `turns` need not increase: a shaft
        that stands still is a constant.
    start : array_like [4] or [jobs, 4]
        x, y (m), vx, vy (m/s) at the first sample; the ring's centre at rest when left out.
    steps : int, optional
        Internal steps per sample, even; when left out, what the job that needs most asks for.

    Returns
    -------
    list of Motion
    """
    from twingap.twins.contact_kernel import LANES, ROWS, integrate  # compiled code: only when it is needed

    where = "contact motion"
    kinds = {(job.bearing.n_rollers, job.parameters.contact, job.turns.size) for job in jobs}
    if len(kinds) != 1:
        raise TwingapError(f"{len(kinds)} kinds of jobs (rollers, contact, samples), one expected", where=where)
    ((n_rollers, contact, samples),) = kinds
    factor = max(job.oversampling() for job in jobs) if steps is None else steps
    if factor % 2 or factor < 2:
        raise TwingapError(f"steps = {factor}, an even number of at least 2 expected", where=where)
    begin = np.broadcast_to(np.asarray(start, dtype=np.float64), (len(jobs), 4))
    groups = -(-len(jobs) // LANES)
    # Lanes left over repeat the last job, as they do where records are made.
    lanes = np.minimum(np.arange(groups * LANES), len(jobs) - 1)
    cage = np.array([_cage(job) for job in jobs])
    turning = np.array([job.turns + job.starts[0] for job in jobs])
    state = np.ascontiguousarray(begin[lanes].reshape(groups, LANES, 4).transpose(0, 2, 1))
    rows = np.array([job.rows(factor) for job in jobs])[lanes].reshape(groups, LANES, len(ROWS)).transpose(0, 2, 1)
    rows = np.ascontiguousarray(rows)
    of_shaft = np.ascontiguousarray(turning[lanes].reshape(groups, LANES, samples).transpose(0, 2, 1))
    of_cage = np.ascontiguousarray(cage[lanes].reshape(groups, LANES, samples).transpose(0, 2, 1))
    first, second = low_pass(factor)
    nothing = np.empty((groups, 0, LANES))
    seen = np.empty((samples, groups, 4, LANES))
    seen[0] = state
    for i in range(samples - 1):
        at = slice(i, i + 2)
        shaft, train = np.ascontiguousarray(of_shaft[:, at]), np.ascontiguousarray(of_cage[:, at])
        integrate(
            n_rollers, state, shaft, train, rows, first, second, nothing, point_contact=contact == "point"
        )  # fmt: skip
        seen[i + 1] = state
    path = seen.transpose(1, 3, 2, 0).reshape(groups * LANES, 4, samples)[: len(jobs)]
    if not np.isfinite(path).all():
        raise TwingapError(
            "the motion leaves the range of numbers", where=where, mend="raise steps, or leave them out"
        )  # fmt: skip
    return [
        Motion(np.arange(samples) / job.condition.fs_hz, x, y, vx, vy, train)
        for job, (x, y, vx, vy), train in zip(jobs, path.copy(), cage, strict=True)
    ]


def _cage(job: Job) -> Array:
    late = 0.0 if job.cage_lag is None else job.cage_lag
    return np.asarray(job.bearing.ftf * job.cage_speed_ratio * (job.turns - late) + job.starts[1])
