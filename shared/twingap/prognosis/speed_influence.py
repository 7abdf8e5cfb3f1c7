"""Influence of speed on healthy amplitude, and normalisation of amplitude by it.

healthy rows: peak to peak, speed --eqs. 9, 10--> SpeedInfluence: S at any speed
any rows:     peak to peak, speed --eq. 11------> normalised peak to peak, about 1 while healthy

The form of the relation is not prescribed, so resonances of the structure are local maxima of S. Source: section 3.2
and 3.3 of paper 1 (Simulation-based remaining useful life prediction of rolling element bearings under varying
operating conditions).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from twingap.errors import TwingapError

Array = NDArray[np.float64]

SAME_SPEED = 0.03
"""Relative spread within which speeds count as one operating speed; larger merges more. The paper's steps differ by 5 %
or more."""


@dataclass(frozen=True)
class SpeedInfluence:
    """S of eq. 10: peak to peak of a healthy bearing as a function of speed.

    Parameters
    ----------
    speeds_rpm : Array [speeds]
        Operating speeds of the healthy rows, increasing, positive.
    c : Array [speeds]
        c of eq. 9 at each, unit of the amplitude per rpm, positive.
    counts : NDArray[int64] [speeds]
        Number of rows of each speed.
    """

    speeds_rpm: Array
    c: Array
    counts: NDArray[np.int64]

    @property
    def rows(self) -> int:
        """Number of rows of all speeds."""
        return int(self.counts.sum())

    def covers(self, speed_rpm: ArrayLike) -> NDArray[np.bool_]:
        """Whether speeds [...] are within those of the healthy rows; outside, S is extrapolated."""
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
            Healthy amplitude, unit of the records; 0 at standstill. Between known speeds, S is interpolated by monotone
            cubics (Fritsch and Carlson 1980, DOI 10.1137/0717021), which have no maxima beyond those of the data.
            Outside, c is that of the closest known speed.
        """
        speed = np.maximum(np.asarray(speed_rpm, float), 0.0)
        outside = np.where(speed < self.speeds_rpm[0], self.c[0], self.c[-1]) * speed
        if self.speeds_rpm.size == 1:
            return np.asarray(outside)
        inside = (speed >= self.speeds_rpm[0]) & (speed <= self.speeds_rpm[-1])
        curve = PchipInterpolator(self.speeds_rpm, self.c * self.speeds_rpm)
        return np.where(inside, curve(np.clip(speed, self.speeds_rpm[0], self.speeds_rpm[-1])), outside)

    def constant(self, speed_rpm: ArrayLike) -> Array:
        """c_k of eq. 10 at speeds [...], unit of the amplitude per rpm; NaN at standstill."""
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
        NaN at standstill.
    """
    p, speed = _rows(peak_to_peak, speed_rpm)
    running = speed > 0
    return np.where(running, p / np.where(running, speed, 1.0), np.nan)


def fit_speed_influence(
    peak_to_peak: ArrayLike, speed_rpm: ArrayLike, *, same_speed: float = SAME_SPEED
) -> SpeedInfluence:
    """Estimate of S from healthy rows, eqs. 9 and 10.

    Parameters
    ----------
    peak_to_peak : array_like [rows]
        Amplitude of healthy records ("a few measurements at the beginning of the operation"). NaN rows are ignored.
    speed_rpm : array_like [rows]
        Speeds; rows at standstill (0) are ignored.
    same_speed : float
        Relative spread within which speeds count as one operating speed; c is the mean over its rows.

    Returns
    -------
    SpeedInfluence

    Raises
    ------
    TwingapError
        When no usable row is left.
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
        # Width is measured from the lowest speed of a group, so that a sweep is not one group.
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
        About 1 while healthy; NaN at standstill.
    """
    p, speed = _rows(peak_to_peak, speed_rpm)
    running = speed > 0
    return np.where(running, p / np.where(running, influence.amplitude(speed), 1.0), np.nan)


def _rows(peak_to_peak: ArrayLike, speed_rpm: ArrayLike) -> tuple[Array, Array]:
    """Both as arrays of equal length."""
    p, speed = np.asarray(peak_to_peak, float), np.asarray(speed_rpm, float)
    if p.ndim != 1 or p.shape != speed.shape:
        raise TwingapError(
            f"{p.shape} amplitudes and {speed.shape} speeds, one of each per row expected", where="peak to peak"
        )
    return p, speed
