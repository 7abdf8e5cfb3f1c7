"""What estimates say of values, while a search moves them to where the twin comes nearest.

estimate: number, and how far nine of ten are off --Student's t--> strain of a value that is moved away from it

Estimates read what no distance on a few records shows: a trend of level over all speeds, a line's frequency to a part
in ten thousand. Where distance is flat in a value, the estimate stands; where it is steep, it gives way, and the
farther off the records' own answer lies, the less it still pulls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from scipy.stats import norm

FREEDOM: Final = 4.0
"""Degrees of freedom of the t-distribution: now and then an estimate is far off without knowing it."""
BINS: Final = 30.0
"""Bins that say something of their own, of the hundreds that a record is compared in."""
_NINE_OF_TEN: Final = float(norm.ppf(0.95))
_EXACT: Final = 1e-6
"""Scale of the error of an estimate that has never been off: it holds, but for plain evidence."""

Key = tuple[str, str]
"""Effect and parameter."""


class Said(NamedTuple):
    """What an estimate says of a value.

    Parameters
    ----------
    number : float
        Comparable, see `training.parameters`.
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
        """Of another value: -2 ln of how much less likely it is than the estimate."""
        return (FREEDOM + 1) * math.log1p((number - self.number) ** 2 / (FREEDOM * self.spread**2))

    def stiffness(self, number: float) -> float:
        """Of a spring that pulls from there as the strain does: weight over the error's variance."""
        off = (number - self.number) ** 2 / self.spread**2
        return (FREEDOM + 1) / (FREEDOM + off) / self.spread**2


def strain(said: Mapping[Key, Said], at: Mapping[Key, float]) -> float:
    """Of several values; 0 at the estimates."""
    return sum(said[key].strain(at[key]) for key in said if key in at)


def pull(records: int) -> float:
    """By how much a strain adds to a squared distance: as much as noise in means of so many records does."""
    return 1 / (BINS * max(records, 1))
