"""Remaining life in revolutions and in time, when speed varies (eq. 14, section 3.6 of paper 1).

A bearing wears by the revolution: remaining revolutions fall smoothly whatever the speed does, and remaining time jumps
with it. At constant speed remaining time has slope -1.
"""

import numpy as np
from numpy.typing import ArrayLike

from papers.arrays import Array
from twingap import TwingapError


def remaining_revolutions(speed_rpm: ArrayLike, dt_s: float) -> Array:
    """Rev_n of eq. 14 [rows], from the anomaly (row 0) to the end of life, where it is 0; `dt_s` is the spacing of
    rows. As printed rpm_K dt revolutions would remain at the end, since the total is summed from K_anomaly and
    subtracted from the row after it; that term is left out."""
    speed = np.asarray(speed_rpm, float)
    if speed.ndim != 1 or speed.size == 0 or not np.isfinite(speed).all() or (speed < 0).any():
        raise TwingapError("one finite speed of at least 0 per row expected", where="speed profile")
    turns = speed * (dt_s / 60)
    return np.asarray(np.cumsum(turns[::-1])[::-1] - turns)


def remaining_time_s(revolutions: ArrayLike, speed_rpm: ArrayLike) -> Array:
    """RUL_n = Rev_n / rpm_n of eq. 14, s [...]: the time left at the present speed; infinite for a machine at
    standstill."""
    left, speed = np.broadcast_arrays(np.asarray(revolutions, float), np.asarray(speed_rpm, float))
    running = speed > 0
    time = 60 * left / np.where(running, speed, 1.0)
    return np.where(running, time, np.where(left > 0, np.inf, 0.0))
