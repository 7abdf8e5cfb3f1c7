"""Prior of remaining life from other runs, pooled with the estimate by growth of this run.

lives of ended runs --> log-normal laws --given the life so far--> median, interval --+
growth of this run, calibrated --widened by past errors--> median, interval ----------+--> weighted mean of logarithms
                                                                                                |
                                       widened by past errors of this mean <--------------------+

Growth alone gives no time scale: amplitude may be constant for most of a run until the bearing fails within minutes.
Quantiles of both sources are averaged in logarithms (Lichtendahl, Grushka-Cockayne and Winkler 2012, DOI
10.2139/ssrn.2066806), with a weight chosen on ended runs (`outcomes.prior_from`). An average of quantiles does not
narrow where errors of the sources are independent, and lives may scatter more or less than assumed, so the width of the
joined intervals is also chosen on ended runs.

A product of densities would suppress the evidence of early growth where lives differ by a factor of two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtri

from twingap.prognosis.life_law import QUANTILES, LifeLaw, LogNormal
from twingap.prognosis.past_errors import Interval, widened

LEARNT: Final = ("growth_weight", "widening", "joined_widening")
"""Fields of `Prior` that are chosen on ended runs, in addition to the laws of lives; see `outcomes.prior_from`."""


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
        Weight of growth in the mean, 0 to 1.
    widening : float
        Factor on the width of intervals by growth, in logarithms; see `past_errors`.
    joined_widening : float
        Factor on the width of the joined intervals, in logarithms.
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
        law: LifeLaw = self.life
        since = lived
        if self.after_onset is not None and self.after_onset.std < self.life.std:
            law, since = self.after_onset, since_onset
        unit, w = per_row / 2, self.growth_weight
        asked = (*shares, 0.5)
        own = np.log(np.add(quantiles_of(widened(growth, self.widening, unit), unit, asked), unit))
        usual = np.log(np.add(law.remaining(since, asked), unit))
        logs = w * own + (1 - w) * usual
        logs = logs[-1] + self.joined_widening * (logs - logs[-1])
        return tuple(max(float(v) - unit, 0.0) for v in np.exp(logs[:-1]))


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
