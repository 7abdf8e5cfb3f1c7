"""What other runs of such bearings say, pooled with what growth says of this one.

lives of runs that ended --> log-normal laws --outlived so far--> median, interval --+
growth of this run, calibrated --widened as past runs needed--> median, interval ----+--> weighted in logarithms

Growth alone has no scale: an amplitude that stands still may do so for ever, and does in half of the public runs, until
the bearing fails within minutes. A logarithmic opinion pool (Genest and Zidek 1986, DOI 10.1214/ss/1177013825) keeps
both at a fixed weight. A product of densities was tried and was worse on four of six FEMTO runs: where lives spread by
a factor of two, it drowns early growth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from twingap.prognosis.past_errors import Interval, widened


@dataclass(frozen=True)
class LogNormal:
    """Of a number of revolutions: the mean and deviation of its natural logarithm."""

    mean: float
    std: float

    def outlived(self, revolutions: float) -> Interval:
        """5 %, 50 % and 95 % of what is left of a life that is longer than so many revolutions."""
        below = min(float(ndtr((np.log(max(revolutions, 1e-9)) - self.mean) / self.std)), 1 - 1e-9)
        ends = (np.exp(self.mean + self.std * ndtri(below + (1 - below) * q)) for q in (0.05, 0.5, 0.95))
        low, middle, high = (max(float(v) - revolutions, 0.0) for v in ends)
        return low, middle, high


@dataclass(frozen=True)
class Prior:
    """What other runs of such bearings showed.

    Parameters
    ----------
    life : LogNormal
        Revolutions from the first row to the end.
    after_onset : LogNormal or None
        Revolutions from the onset of the anomaly to the end; None when no run had one.
    growth_weight : float
        Weight of growth in the pool, 0 to 1. Leaving out each FEMTO bearing in turn, the others choose 0.75
        or 1.
    widening : float
        Of growth's intervals, in logarithms; see `past_errors`.
    """

    life: LogNormal
    after_onset: LogNormal | None = None
    growth_weight: float = 0.75
    widening: float = 1.0

    def before(self, lived: float) -> Interval:
        """5 %, 50 % and 95 % of remaining revolutions before any anomaly."""
        return self.life.outlived(lived)

    def joined(self, growth: Interval, lived: float, since_onset: float, per_row: float) -> Interval:
        """5 %, 50 % and 95 % of remaining revolutions after the onset.

        Parameters
        ----------
        growth : tuple of float
            The same by growth alone.
        lived, since_onset : float
            Revolutions since the first row, and since the onset.
        per_row : float
            Revolutions from row to row; half of them are added to lives before their logarithm.
        """
        law, since = self.life, lived
        if self.after_onset is not None and self.after_onset.std < self.life.std:
            law, since = self.after_onset, since_onset
        usual, unit, w = law.outlived(since), per_row / 2, self.growth_weight
        own = widened(growth, self.widening, unit)
        pooled = [np.exp(w * np.log(a + unit) + (1 - w) * np.log(b + unit)) for a, b in zip(own, usual, strict=True)]
        low, middle, high = (max(float(v) - unit, 0.0) for v in pooled)
        return low, middle, high
