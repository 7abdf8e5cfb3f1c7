"""Remaining life in revolutions and in time, when speed varies (eq. 14).

speeds until the end --eq. 14--> remaining revolutions [rows] (labels) --/ speed--> remaining time, at the present speed

A bearing wears by the revolution: remaining revolutions fall smoothly whatever the speed does, and remaining time jumps
with it. At constant speed remaining time has slope -1. Source: section 3.6 of paper 1.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError

Array = NDArray[np.float64]

Convention = Literal["zero_at_end", "printed"]


def remaining_revolutions(speed_rpm: ArrayLike, dt_s: ArrayLike, convention: Convention = "zero_at_end") -> Array:
    """Rev_n of eq. 14 for every row from the anomaly to the end of life.

    Parameters
    ----------
    speed_rpm : array_like [rows]
        Rows K_anomaly to N, the last being the end of life.
    dt_s : float or array_like [rows]
        Time from the row before to this row, s. The paper calls it "the length of each measurement"; revolutions
        between measurements count as well, so it is their spacing.
    convention : {"zero_at_end", "printed"}
        Eq. 14 as printed sums its total from K_anomaly but subtracts from the row after it, so that rpm_K dt
        revolutions remain at the end of life. "zero_at_end" leaves that term out.

    Returns
    -------
    Array [rows]
        Revolutions, row n = 0 being K_anomaly itself.
    """
    speed, dt_min = _profile(speed_rpm, dt_s)
    turns = speed * dt_min
    after = np.cumsum(turns[::-1])[::-1] - turns
    return after + turns[0] if convention == "printed" else after


def remaining_time_s(revolutions: ArrayLike, speed_rpm: ArrayLike) -> Array:
    """RUL_n = Rev_n / rpm_n of eq. 14: the time left if the machine goes on at its present speed.

    Parameters
    ----------
    revolutions, speed_rpm : array_like [...]

    Returns
    -------
    Array [...]
        s; inf where the machine stands still with revolutions left.
    """
    left, speed = np.broadcast_arrays(np.asarray(revolutions, float), np.asarray(speed_rpm, float))
    running = speed > 0
    time = 60 * left / np.where(running, speed, 1.0)
    return np.where(running, time, np.where(left > 0, np.inf, 0.0))


def _profile(speed_rpm: ArrayLike, dt_s: ArrayLike) -> tuple[Array, Array]:
    """Speeds [rows] and their durations [rows] in minutes."""
    speed = np.asarray(speed_rpm, float)
    if speed.ndim != 1 or speed.size == 0 or not np.isfinite(speed).all() or (speed < 0).any():
        raise TwingapError("one finite speed of at least 0 per row expected", where="speed profile")
    dt_s = np.asarray(dt_s, float)
    if dt_s.ndim > 1 or dt_s.size not in (1, speed.size) or not np.isfinite(dt_s).all() or (dt_s < 0).any():
        raise TwingapError(
            f"durations of shape {dt_s.shape} for {speed.size} rows, one or one a row, none negative, expected",
            where="speed profile",
        )
    return speed, np.broadcast_to(dt_s / 60, speed.shape)
