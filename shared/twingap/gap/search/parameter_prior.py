"""Priors of parameters: penalties on values that a search moves away from their estimates.

estimate and the bound of nine of ten errors --Student's t--> penalty of another value

Estimators use features that a distance on a few records does not resolve: a trend of level over all speeds, a line
frequency to a part in ten thousand. Where the distance does not depend on a value, the estimate is kept; where it does,
the value moves. The penalty grows more slowly the farther the value is from the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from scipy.stats import norm

FREEDOM: Final = 4.0
"""Degrees of freedom of the t-distribution. Fewer weaken the prior where records contradict an estimate."""
BINS: Final = 30.0
"""Number of independent bins in a comparison of records. A larger value weakens all priors relative to the distance."""
_NINE_OF_TEN: Final = float(norm.ppf(0.95))
"""Standard deviations that bound nine of ten Gaussian errors."""
_EXACT: Final = 1e-6
"""Smallest scale of an estimate's error. It keeps the penalty of an exact estimate finite."""

Key = tuple[str, str]
"""Effect and parameter."""


class Prior(NamedTuple):
    """Prior of one value, from its estimate."""

    number: float  # the estimate, on the scale of `parameter_scale`
    within: float  # bound on the error of nine of ten such estimates, on the same scale
    weight: float = 1.0  # factor on the penalty, larger where the estimate is from more records than the distance

    @property
    def spread(self) -> float:
        """Scale of the estimate's error: its standard deviation if errors were Gaussian."""
        return max(self.within / _NINE_OF_TEN, _EXACT)

    def penalty(self, number: float) -> float:
        """Penalty of another value: -2 ln of the ratio of its density to that of the estimate."""
        return self.weight * (FREEDOM + 1) * math.log1p((number - self.number) ** 2 / (FREEDOM * self.spread**2))

    def stiffness(self, number: float) -> float:
        """Curvature of the penalty in iteratively reweighted least squares: weight over the error's variance."""
        off = (number - self.number) ** 2 / self.spread**2
        return self.weight * (FREEDOM + 1) / (FREEDOM + off) / self.spread**2


def penalty(priors: Mapping[Key, Prior], at: Mapping[Key, float]) -> float:
    """Sum of the penalties of several values; 0 at the estimates."""
    return sum(priors[key].penalty(at[key]) for key in priors if key in at)


def penalty_weight(records: int) -> float:
    """Weight of a penalty relative to a squared distance; the noise of its means decreases with more records."""
    return 1 / (BINS * max(records, 1))
