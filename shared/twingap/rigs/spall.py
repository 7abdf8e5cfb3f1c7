"""Damage of a raceway over a life: nothing, then a first flake, then growth in random stages; and what a ball does.

turns since the onset --random stages--> growth time --Paris--> length of the spall [mm]
length, speed --geometry--> speed of impact --Hertz--> force and duration of a ball's strike at the far edge

The growth follows turns under load, so that a life at lower speed lasts longer in time. It is not the law of any twin:
no exponential in time, and its stages (edges that roll out, flakes that break off) leave no smooth curve behind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.bearing import Bearing

Array = NDArray[np.float64]

CONTACT_STIFFNESS = 1.0e10
"""Ball on raceway, N/m^1.5."""
STRIKING_MASS_KG = 0.06
"""What a ball's strike sets in motion at once: the ball and the seat around it."""


@dataclass(frozen=True)
class Growth:
    """One history of growth, scaled to a given length at its end.

    Parameters
    ----------
    exponent : float
        m of da/dN = C w a^m, not 1.
    flake_mm : float
        Length to which the first flakes break out, soon after the onset.
    flake_turns : float
        Turns in which that happens.
    stage_turns, stage_time : Array [stages + 1]
        Turns since the onset, and growth time at them, both increasing from 0; growth time ends at 1.
    """

    exponent: float
    flake_mm: float
    flake_turns: float
    stage_turns: Array
    stage_time: Array

    @classmethod
    def draw(cls, rng: np.random.Generator, turns: float, flake_mm: float) -> Growth:
        """A random history that ends `turns` after the onset, with first flakes of this length."""
        lengths = rng.gamma(4.0, turns / 40, 200)  # ten stages or so
        edges = np.concatenate([[0.0], np.cumsum(lengths)])
        edges = np.append(edges[edges < turns], turns)
        pace = np.exp(rng.normal(0.0, 0.35, edges.size - 1))
        time = np.concatenate([[0.0], np.cumsum(pace * np.diff(edges))])
        return cls(
            exponent=float(rng.uniform(1.2, 2.0)),
            flake_mm=flake_mm,
            flake_turns=float(rng.uniform(0.02, 0.05) * turns),
            stage_turns=edges,
            stage_time=time / time[-1],
        )

    def length_mm(self, turns: ArrayLike, end_mm: float) -> Array:
        """Length of the spall.

        Parameters
        ----------
        turns : array_like [...]
            Since the onset; negative before it.
        end_mm : float
            Length at the end.

        Returns
        -------
        Array [...]
            mm along the raceway; 0 before the onset.
        """
        n = np.maximum(np.asarray(turns, float), 0.0)
        time = np.interp(n, self.stage_turns, self.stage_time)
        # Paris' law integrates to a^(1 - m) falling linearly with growth time.
        power = 1 - self.exponent
        first, last = self.flake_mm**power, end_mm**power
        grown = (first + (last - first) * time) ** (1 / power)
        # The flakes are complete at the end, so that its length is met to the last digit.
        broken_out = np.expm1(-n / self.flake_turns) / np.expm1(-self.stage_turns[-1] / self.flake_turns)
        return np.asarray(grown * np.minimum(broken_out, 1.0))


def impact(bearing: Bearing, length_mm: float, rolling_m_s: ArrayLike) -> tuple[Array, Array]:
    """Peak force and duration of a loaded ball's strike at the far edge of a spall.

    The ball's centre dips between the edges and is turned by about length / diameter on leaving; the part of its speed
    across that angle is stopped by a Hertzian contact (Johnson, Contact Mechanics, 1985, section 11.4).

    Parameters
    ----------
    bearing : Bearing
    length_mm : float
        Positive.
    rolling_m_s : array_like [strikes]
        Speed of the ball's centre along the damaged raceway.

    Returns
    -------
    force_n, duration_s : Array [strikes]
    """
    across = np.asarray(rolling_m_s, float) * length_mm / bearing.roller_diameter_mm
    depth_m = (1.25 * STRIKING_MASS_KG * across**2 / CONTACT_STIFFNESS) ** 0.4
    return np.asarray(CONTACT_STIFFNESS * depth_m**1.5), np.asarray(2.94 * depth_m / across)
