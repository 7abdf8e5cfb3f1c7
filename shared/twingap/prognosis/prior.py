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

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr, ndtri

from twingap.prognosis.past_errors import Interval, widened

LEARNT: Final = ("growth_weight", "widening", "joined_widening")
"""Fields of `Prior` that are chosen on ended runs, in addition to the laws of lives; see `outcomes.prior_from`."""


@dataclass(frozen=True)
class LogNormal:
    """Log-normal law of a number of revolutions: mean and standard deviation of its natural logarithm."""

    mean: float
    std: float

    def remaining(self, revolutions: float) -> Interval:
        """Quantiles of 5 %, 50 % and 95 % of the remaining life, given that it is longer than `revolutions`."""
        below = min(float(ndtr((np.log(max(revolutions, 1e-9)) - self.mean) / self.std)), 1 - 1e-9)
        ends = (np.exp(self.mean + self.std * ndtri(below + (1 - below) * q)) for q in (0.05, 0.5, 0.95))
        low, middle, high = (max(float(v) - revolutions, 0.0) for v in ends)
        return low, middle, high


@dataclass(frozen=True)
class Prior:
    """Prior of remaining life from ended runs of bearings of the same kind.

    Parameters
    ----------
    life : LogNormal
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

    life: LogNormal
    after_onset: LogNormal | None = None
    growth_weight: float = 0.75
    widening: float = 1.0
    joined_widening: float = 1.0

    def before(self, lived: float) -> Interval:
        """Quantiles of 5 %, 50 % and 95 % of remaining revolutions before an anomaly, after `lived` revolutions."""
        return self.life.remaining(lived)

    def joined(self, growth: Interval, lived: float, since_onset: float, per_row: float) -> Interval:
        """Quantiles of 5 %, 50 % and 95 % of remaining revolutions after the onset.

        Parameters
        ----------
        growth : tuple of float
            The same quantiles by growth alone.
        lived, since_onset : float
            Revolutions since the first row, and since the onset.
        per_row : float
            Mean revolutions between rows; half of them are added before taking logarithms.
        """
        law, since = self.life, lived
        if self.after_onset is not None and self.after_onset.std < self.life.std:
            law, since = self.after_onset, since_onset
        unit, w = per_row / 2, self.growth_weight
        own, usual = (np.log(np.add(v, unit)) for v in (widened(growth, self.widening, unit), law.remaining(since)))
        low, middle, high = (max(float(v) - unit, 0.0) for v in np.exp(w * own + (1 - w) * usual))
        return widened((low, middle, high), self.joined_widening, unit)
