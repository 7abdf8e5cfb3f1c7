"""Prior of remaining life from other runs, pooled with the estimate by growth of this run.

lives of ended runs --> law of life (`life_law`) --given the life so far--> density of remaining life ---+
growth of this run, calibrated --widened by past errors--> density of remaining life ^ growth_weight ----+--> product
                                                                                                            |
                                              quantiles, widened by past errors of this product <-----------+

Growth alone gives no time scale: amplitude may be constant for most of a run until the bearing fails within minutes. In
a product of densities the narrower source prevails, which is the law of lives early in a run and growth near its end.
The weight of growth, an exponent (logarithmic opinion pool, Genest and Zidek 1986, DOI 10.1214/ss/1177013825), and the
width of the intervals are chosen on ended runs (`outcomes.prior_from`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from twingap.prognosis.life_law import QUANTILES, LifeLaw, LogNormal
from twingap.prognosis.past_errors import Interval

Array = NDArray[np.float64]

LEARNT: Final = ("growth_weight", "widening", "joined_widening")
"""Fields of `Prior` that are chosen on ended runs, in addition to the laws of lives; see `outcomes.prior_from`."""
_POINTS: Final = 400
"""Points of the grid of log remaining life; more resolve narrower densities and are slower."""
_NARROWEST: Final = 0.05
"""Least standard deviation of log remaining life by growth, about the spacing of the grid."""


@dataclass(frozen=True)
class Prior:
    """Prior of remaining life from ended runs of bearings of the same kind.

    Parameters
    ----------
    life : LogNormal or Mixture
        Revolutions from the first row to the end.
    after_onset : LogNormal or None
        Revolutions from the onset of the anomaly to the end; None when no run had one.
    growth_weight : float
        Exponent of the density by growth; 1 takes growth and lives as independent sources, and a large one leaves
        growth alone.
    widening : float
        Factor on the width of intervals by growth, in logarithms; see `past_errors`.
    joined_widening : float
        Factor on the width of the pooled intervals, in logarithms.
    """

    life: LifeLaw
    after_onset: LogNormal | None = None
    growth_weight: float = 0.75
    widening: float = 1.0
    joined_widening: float = 1.0

    def before(self, lived: float, shares: Sequence[float] = QUANTILES) -> tuple[float, ...]:
        """Quantiles of remaining revolutions before an anomaly, after `lived` revolutions."""
        return self.life.remaining(lived, shares)

    def joined(
        self, growth: Interval, lived: float, since_onset: float, per_row: float, shares: Sequence[float] = QUANTILES
    ) -> tuple[float, ...]:
        """Quantiles of remaining revolutions after the onset.

        Parameters
        ----------
        growth : tuple of float
            Quantiles of 5 %, 50 % and 95 % by growth alone.
        lived, since_onset : float
            Revolutions since the first row, and since the onset.
        per_row : float
            Mean revolutions between rows; half of them are added before taking logarithms.
        shares : sequence of float
            Quantiles that are returned.
        """
        rows = (np.array([growth], float), np.array([lived], float), np.array([since_onset], float))
        return tuple(float(v) for v in self.joined_rows(*rows, per_row, shares)[0])

    def joined_rows(
        self, growth: Array, lived: Array, since_onset: Array, per_row: float, shares: Sequence[float] = QUANTILES
    ) -> Array:
        """`joined` of several rows: [rows, 3], [rows], [rows] --> [rows, shares]."""
        z, density = self._pooled(growth, lived, since_onset, per_row)
        cumulated = np.cumsum(density, axis=1) - density / 2
        asked = (*shares, 0.5)
        logs = np.array([np.interp(asked, own / own[-1], z) for own in cumulated])
        middle = logs[:, -1:]
        logs = middle + self.joined_widening * (logs[:, :-1] - middle)
        return np.asarray(np.maximum(np.exp(logs) - per_row / 2, 0.0))

    def _pooled(self, growth: Array, lived: Array, since_onset: Array, per_row: float) -> tuple[Array, Array]:
        """Grid of log remaining life plus half a row, and the density of each row on it."""
        law: LifeLaw = self.life
        since = lived
        if self.after_onset is not None and self.after_onset.std < self.life.std:
            law, since = self.after_onset, since_onset
        top = max(law.mean + 4.5 * law.std, float(np.log(since.max() + 1e-9)) + 2, float(np.log(growth.max() + 1e-9)))
        unit = max(per_row / 2, float(np.exp(top - 25)))
        z = np.linspace(np.log(unit), top, _POINTS)
        total = np.log(np.maximum(since[:, None] + np.exp(z) - unit, 1e-9))
        logs = law.log_density(total) + z - total
        low, middle, high = (np.log(growth[:, k] + unit)[:, None] for k in range(3))
        std = np.where(z > middle, high - middle, middle - low) * self.widening / ndtri(0.95)
        logs = logs - self.growth_weight / 2 * ((z - middle) / np.maximum(std, _NARROWEST)) ** 2
        density = np.exp(logs - logs.max(axis=1, keepdims=True))
        return z, density / (density.sum(axis=1, keepdims=True) * (z[1] - z[0]))


def quantiles_of(interval: Interval, unit: float, shares: Sequence[float]) -> tuple[float, ...]:
    """Quantiles of a law of which those of 5 %, 50 % and 95 % are known: log-normal on either side of the median.

    Parameters
    ----------
    interval : tuple of float
    unit : float
        Added before taking logarithms.
    shares : sequence of float
    """
    low, middle, high = np.log(np.add(interval, unit))
    z = ndtri(np.asarray(shares, float)) / ndtri(0.95)
    logs = middle + z * np.where(z > 0, high - middle, middle - low)
    return tuple(max(float(v) - unit, 0.0) for v in np.exp(logs))
