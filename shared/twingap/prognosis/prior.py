"""Prior of remaining life from other runs, pooled with the estimate by growth of this run.

lives of runs that ended --> log-normal laws --outlived so far--> median, interval --+
growth of this run, calibrated --widened as past runs needed--> median, interval ----+--> weighted in logarithms
                                                                                             |
                               widened again, as the same of past runs needed <--------------+

Growth alone has no scale: an amplitude that stands still may do so for ever, and does in half of the public runs, until
the bearing fails within minutes. Both are kept at a weight chosen on runs that have ended (`outcomes.prior_from`), and
their quantiles averaged in logarithms (Lichtendahl, Grushka-Cockayne and Winkler 2012, DOI 10.2139/ssrn.2066806). Two
sources that err independently have a mean that is surer than either, which an average of their quantiles does not know,
and lives may spread more or less than is supposed: the width of intervals of the mean is chosen on past runs as well.

A product of densities would suppress early growth where lives spread by a factor of two; weights by the stated
precision of each source are no better.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr, ndtri

from twingap.prognosis.past_errors import Interval, widened

LEARNT: Final = ("growth_weight", "widening", "joined_widening")
"""Fields of `Prior` that are chosen on runs that have ended, besides the laws of lives; see `outcomes.prior_from`."""


@dataclass(frozen=True)
class LogNormal:
    """Log-normal law of a number of revolutions: mean and standard deviation of its natural logarithm."""

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
    """Prior of remaining life from other runs of such bearings.

    Parameters
    ----------
    life : LogNormal
        Revolutions from the first row to the end.
    after_onset : LogNormal or None
        Revolutions from the onset of the anomaly to the end; None when no run had one.
    growth_weight : float
        Weight of growth in the mean, 0 to 1.
    widening : float
        Of growth's intervals, in logarithms; see `past_errors`.
    joined_widening : float
        The same of the mean's, after growth's.
    """

    life: LogNormal
    after_onset: LogNormal | None = None
    growth_weight: float = 0.75
    widening: float = 1.0
    joined_widening: float = 1.0

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
        unit, w = per_row / 2, self.growth_weight
        own, usual = (np.log(np.add(v, unit)) for v in (widened(growth, self.widening, unit), law.outlived(since)))
        low, middle, high = (max(float(v) - unit, 0.0) for v in np.exp(w * own + (1 - w) * usual))
        return widened((low, middle, high), self.joined_widening, unit)
