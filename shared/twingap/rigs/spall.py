"""Growth of a spall over a bearing's life, in random stages, and the impact of a ball on it.

turns since the onset --random stages--> growth time --Paris--> length of the spall [mm]
length, speed --geometry--> speed of impact --Hertz--> force and duration of a ball's impact at the far edge

Growth depends on turns under load, so a life at lower speed lasts longer in time. It differs from the law of every
twin: it is no exponential of time, and its stages (edges that roll out, flakes that break off) make it irregular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.bearing import Bearing

Array = NDArray[np.float64]

CONTACT_STIFFNESS = 1.0e10
"""Contact stiffness of a ball on a raceway, N/m^1.5."""
IMPACT_MASS_KG = 0.06
"""Effective mass of an impact: the ball and the seat around it, kg. Larger gives stronger and longer impacts."""


@dataclass(frozen=True)
class Growth:
    """Random growth history, scaled to a given length at its end.

    Parameters
    ----------
    exponent : float
        Exponent m of da/dN = C w a^m, not 1.
    flake_mm : float
        Length of the first flakes, which break out soon after the onset, mm.
    flake_turns : float
        Turns within which the first flakes break out.
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
        lengths = rng.gamma(4.0, turns / 40, 200)  # about ten stages
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
            Turns since the onset; negative before it.
        end_mm : float
            Length at the end, mm.

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
        # Scaled so that the length at the end is exactly `end_mm`.
        broken_out = np.expm1(-n / self.flake_turns) / np.expm1(-self.stage_turns[-1] / self.flake_turns)
        return np.asarray(grown * np.minimum(broken_out, 1.0))


def impact(bearing: Bearing, length_mm: float, rolling_m_s: ArrayLike) -> tuple[Array, Array]:
    """Peak force and duration of a loaded ball's impact at the far edge of a spall.

    The ball's centre sinks between the edges, and its direction changes by an angle of about length / diameter at the
    far edge. The component of its speed across that angle is stopped by a Hertzian contact (Johnson, Contact Mechanics,
    1985, section 11.4).

    Parameters
    ----------
    bearing : Bearing
    length_mm : float
        Length of the spall, mm, positive.
    rolling_m_s : array_like [impacts]
        Speed of the ball's centre along the damaged raceway, m/s.

    Returns
    -------
    force_n, duration_s : Array [impacts]
    """
    across = np.asarray(rolling_m_s, float) * length_mm / bearing.roller_diameter_mm
    depth_m = (1.25 * IMPACT_MASS_KG * across**2 / CONTACT_STIFFNESS) ** 0.4
    return np.asarray(CONTACT_STIFFNESS * depth_m**1.5), np.asarray(2.94 * depth_m / across)
