"""Motion in the contact model: displacement and velocity of the inner ring.

The kernel of `contact_kernel` hands back a trajectory's state where a call ends. Here every call lasts one sample, so
that each state is seen; the trajectory is that of one long call, to the bit, because the kernel anchors its recurrences
anew at every sample. Figures 5 and 6 of paper 2 (a normal bearing settling to balance) are of these quantities.
"""

from dataclasses import dataclass

import numpy as np

from papers.arrays import Array
from twingap import TwingapError
from twingap.twins.contact_dynamics import Job, low_pass


@dataclass(frozen=True)
class Motion:
    """Where the inner ring's centre is, and how fast it moves."""

    t_s: Array  # [samples] time since the start, s
    state: Array  # [4, samples] displacement across and along the load, m, and velocity, m/s: x, y, vx, vy
    cage_turns: Array  # [samples] angle of the cage: roller j stands at 2 pi (cage_turns + j / Z)


def motion_of(job: Job, steps: int | None = None) -> Motion:
    """Integrate a job (whose `turns` need not increase) from rest at the centre by RK4 with a fixed step, `steps` per
    sample if given, and keep every sample's state. Raises `TwingapError` when it leaves the range of numbers."""
    # Compiled code, imported on use.
    from twingap.twins.contact_integration import integrate
    from twingap.twins.contact_kernel import LANES

    factor = job.oversampling() if steps is None else steps
    late = 0.0 if job.cage_lag is None else job.cage_lag
    cage = np.asarray(job.bearing.ftf * job.cage_speed_ratio * (job.turns - late) + job.starts[1])
    # All lanes of the kernel's one group are the same.
    rows = np.tile(np.array(job.rows(factor))[None, :, None], (1, 1, LANES))
    shaft, train = (np.tile(turns[None, :, None], (1, 1, LANES)) for turns in (job.turns + job.starts[0], cage))
    first, second = low_pass(factor)
    state, nothing = np.zeros((1, 4, LANES)), np.empty((1, 0, LANES))
    seen, point = np.zeros((4, job.turns.size)), job.parameters.contact == "point"
    for i in range(job.turns.size - 1):
        here, there = (np.ascontiguousarray(turns[:, i : i + 2]) for turns in (shaft, train))
        integrate(job.bearing.n_rollers, state, here, there, rows, first, second, nothing, point_contact=point)
        seen[:, i + 1] = state[0, :, 0]
    if not np.isfinite(seen).all():
        raise TwingapError(
            "the motion leaves the range of numbers", where="contact motion", mend="raise steps, or leave them out"
        )
    return Motion(np.arange(job.turns.size) / job.condition.fs_hz, seen, cage)
