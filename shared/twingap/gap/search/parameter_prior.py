"""Priors of parameters: penalties on values that a search moves away from their estimates.

estimate: number, and how far nine of ten are off --Student's t--> penalty ("strain") of another value

Estimates use what no distance on a few records shows: a trend of level over all speeds, a line's frequency to a part in
ten thousand. Where the distance is flat in a value, the estimate stands; where it is steep, the value moves, and the
farther off the records' own optimum lies, the less the estimate still pulls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from scipy.stats import norm

FREEDOM: Final = 4.0
"""Degrees of freedom of the t-distribution. Fewer give way sooner to records that contradict an estimate."""
BINS: Final = 30.0
"""Independent bins among the hundreds in which records are compared. More weaken all priors beside the distance."""
_NINE_OF_TEN: Final = float(norm.ppf(0.95))
_EXACT: Final = 1e-6
"""Least scale of an estimate's error, so that even one that has never been off gives way to plain evidence."""

Key = tuple[str, str]
"""Effect and parameter."""


class Said(NamedTuple):
    """Prior of one value, from its estimate.

    Parameters
    ----------
    number : float
        Comparable between machines, see `parameter_scale`.
    within : float
        Nine of ten estimates like it are off by less.
    """

    number: float
    within: float

    @property
    def spread(self) -> float:
        """Scale of its error: a standard deviation, if errors were Gaussian."""
        return max(self.within / _NINE_OF_TEN, _EXACT)

    def strain(self, number: float) -> float:
        """Penalty of another value: -2 ln of how much less likely it is than the estimate."""
        return (FREEDOM + 1) * math.log1p((number - self.number) ** 2 / (FREEDOM * self.spread**2))

    def stiffness(self, number: float) -> float:
        """Stiffness of a spring that pulls from there as the penalty does: weight over the error's variance."""
        off = (number - self.number) ** 2 / self.spread**2
        return (FREEDOM + 1) / (FREEDOM + off) / self.spread**2


def strain(said: Mapping[Key, Said], at: Mapping[Key, float]) -> float:
    """Penalty of several values; 0 at the estimates."""
    return sum(said[key].strain(at[key]) for key in said if key in at)


def pull(records: int) -> float:
    """Weight of a penalty beside a squared distance: as much as noise in means of so many records."""
    return 1 / (BINS * max(records, 1))
