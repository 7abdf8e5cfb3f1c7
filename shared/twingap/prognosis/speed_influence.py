"""Influence of speed on healthy amplitude, and normalisation of amplitude by it.

healthy rows: peak to peak, speed --eqs. 9, 10--> SpeedInfluence: S at any speed
any rows:     peak to peak, speed --eq. 11------> normalised peak to peak, about 1 while healthy

Nothing is assumed of the relation's form: a speed at which the structure resonates is a local maximum of S like any
other. Source: section 3.2 and 3.3 of paper 1 (Simulation-based remaining useful life prediction of rolling element
bearings under varying operating conditions).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from twingap.errors import TwingapError

Array = NDArray[np.float64]

SAME_SPEED = 0.03
"""Relative spread within which speeds are one operating speed: the paper's own steps are 5 % and more apart."""


@dataclass(frozen=True)
class SpeedInfluence:
    """S of eq. 10: the peak to peak of a healthy bearing as a function of speed.

    Parameters
    ----------
    speeds_rpm : Array [speeds]
        Operating speeds seen while healthy, increasing, positive.
    c : Array [speeds]
        c of eq. 9 at each, unit of the amplitude per rpm, positive.
    counts : NDArray[int64] [speeds]
        Rows behind each.
    """

    speeds_rpm: Array
    c: Array
    counts: NDArray[np.int64]

    @property
    def rows(self) -> int:
        """Rows behind all speeds."""
        return int(self.counts.sum())

    def covers(self, speed_rpm: ArrayLike) -> NDArray[np.bool_]:
        """Whether a speed lies within those seen while healthy: beyond them S is extrapolated."""
        speed = np.asarray(speed_rpm, float)
        low, high = self.speeds_rpm[0] * (1 - SAME_SPEED), self.speeds_rpm[-1] * (1 + SAME_SPEED)
        return np.asarray((speed >= low) & (speed <= high))

    def amplitude(self, speed_rpm: ArrayLike) -> Array:
        """S(k) = c_k rpm_k, eq. 10.

        Parameters
        ----------
        speed_rpm : array_like [...]

        Returns
        -------
        Array [...]
            Unit of the amplitude. Between speeds seen, S itself is interpolated by monotone cubics (Fritsch and Carlson
            1980, DOI 10.1137/0717021): it passes through every point and has no maximum where the data have none, so
            that a resonance is as high as it was measured and no higher. Beyond them c stays that of the nearest
            speed. 0 at a stopped machine.
        """
        speed = np.maximum(np.asarray(speed_rpm, float), 0.0)
        outside = np.where(speed < self.speeds_rpm[0], self.c[0], self.c[-1]) * speed
        if self.speeds_rpm.size == 1:
            return np.asarray(outside)
        inside = (speed >= self.speeds_rpm[0]) & (speed <= self.speeds_rpm[-1])
        curve = PchipInterpolator(self.speeds_rpm, self.c * self.speeds_rpm)
        return np.where(inside, curve(np.clip(speed, self.speeds_rpm[0], self.speeds_rpm[-1])), outside)

    def constant(self, speed_rpm: ArrayLike) -> Array:
        """c_k of eq. 10 at speeds [...], unit of the amplitude per rpm; NaN at a stopped machine."""
        speed = np.asarray(speed_rpm, float)
        running = speed > 0
        return np.where(running, self.amplitude(speed) / np.where(running, speed, 1.0), np.nan)


def speed_constants(peak_to_peak: ArrayLike, speed_rpm: ArrayLike) -> Array:
    """c_j = P_j / rpm_j, eq. 9.

    Parameters
    ----------
    peak_to_peak, speed_rpm : array_like [rows]

    Returns
    -------
    Array [rows]
        NaN where the machine stands still.
    """
    p, speed = _rows(peak_to_peak, speed_rpm)
    running = speed > 0
    return np.where(running, p / np.where(running, speed, 1.0), np.nan)


def fit_speed_influence(
    peak_to_peak: ArrayLike, speed_rpm: ArrayLike, *, same_speed: float = SAME_SPEED
) -> SpeedInfluence:
    """Learn S from healthy rows, eqs. 9 and 10.

    Parameters
    ----------
    peak_to_peak : array_like [rows]
        Of healthy records: "a few measurements at the beginning of the operation". NaN rows are left out.
    speed_rpm : array_like [rows]
        Rows at which the machine stands still (0) are left out.
    same_speed : float
        Speeds within this relative spread are one operating speed; c is the mean over its rows.

    Returns
    -------
    SpeedInfluence

    Raises
    ------
    TwingapError
        When no row is left.
    """
    c = speed_constants(peak_to_peak, speed_rpm)
    speed = np.asarray(speed_rpm, float)
    kept = np.isfinite(c) & (c > 0)
    if not kept.any():
        raise TwingapError(
            "no row has both a speed and a vibration above 0",
            where="healthy rows", mend="begin with rows of the running machine",
        )  # fmt: skip
    order = np.argsort(speed[kept], kind="stable")
    speed, c = speed[kept][order], c[kept][order]
    groups: list[slice] = []
    first = 0
    for place in range(1, speed.size + 1):
        # A band from its lowest speed on, not a chain of neighbours: a sweep must not melt into one speed.
        if place == speed.size or speed[place] > speed[first] * (1 + same_speed):
            groups.append(slice(first, place))
            first = place
    return SpeedInfluence(
        np.array([speed[g].mean() for g in groups]),
        np.array([c[g].mean() for g in groups]),
        np.array([g.stop - g.start for g in groups], dtype=np.int64),
    )


def normalised_peak_to_peak(peak_to_peak: ArrayLike, speed_rpm: ArrayLike, influence: SpeedInfluence) -> Array:
    """P_N,j = P_j / (c_j rpm_j), eq. 11: peak to peak with the influence of speed removed.

    Parameters
    ----------
    peak_to_peak, speed_rpm : array_like [rows]
    influence : SpeedInfluence

    Returns
    -------
    Array [rows]
        About 1 while healthy; NaN where the machine stands still.
    """
    p, speed = _rows(peak_to_peak, speed_rpm)
    running = speed > 0
    return np.where(running, p / np.where(running, influence.amplitude(speed), 1.0), np.nan)


def _rows(peak_to_peak: ArrayLike, speed_rpm: ArrayLike) -> tuple[Array, Array]:
    """Both as arrays of one length."""
    p, speed = np.asarray(peak_to_peak, float), np.asarray(speed_rpm, float)
    if p.ndim != 1 or p.shape != speed.shape:
        raise TwingapError(
            f"{p.shape} amplitudes and {speed.shape} speeds, one of each per row expected", where="peak to peak"
        )
    return p, speed
