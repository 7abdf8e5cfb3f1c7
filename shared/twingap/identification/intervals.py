"""Intervals for identified parameters: the jackknife over recordings.

Records of one group (one recording, one mounted bearing) share more than their parameters, so groups are left out in
turn. The spread of the estimates gives a standard error, and Student's t with one degree of freedom less than clusters
the width of the interval; with two groups it is wide (t = 6.3 at 90 %). Source: Tukey 1958; Efron
and Stein 1981, doi:10.1214/aos/1176345462.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

Array = NDArray[np.float64]

MOST_CLUSTERS = 12
"""Most clusters, to which groups are pooled; more are slower and hardly improve intervals."""


@dataclass(frozen=True)
class Spread:
    """Variances of several estimates, with their degrees of freedom.

    Parameters
    ----------
    variance : Array [estimates]
    freedom : Array [estimates]
        Degrees of freedom.
    """

    variance: Array
    freedom: Array

    def __add__(self, other: Spread) -> Spread:
        """Spread of a sum of independent estimates; degrees of freedom after Satterthwaite 1946."""
        total = self.variance + other.variance
        below = self.variance**2 / self.freedom + other.variance**2 / other.freedom
        freedom = np.where(below > 0, total**2 / np.where(below > 0, below, 1), self.freedom + other.freedom)
        return Spread(total, freedom)

    def at(self, place: int) -> Spread:
        """Spread of one of the estimates."""
        return Spread(self.variance[place : place + 1], self.freedom[place : place + 1])

    def interval(self, estimate: Array, level: float) -> Array:
        """Two-sided interval [estimates, 2] around `estimate`."""
        half = student.ppf(0.5 + level / 2, self.freedom) * np.sqrt(self.variance)
        return np.stack([estimate - half, estimate + half], axis=-1)


def clusters(groups: Sequence[str]) -> NDArray[np.int64]:
    """Cluster of each record: its group, pooled if there are many; the record itself if all are of one group."""
    distinct = list(dict.fromkeys(groups))
    if len(distinct) == 1:
        return np.arange(len(groups)) % MOST_CLUSTERS
    place = {group: i % MOST_CLUSTERS for i, group in enumerate(distinct)}
    return np.array([place[group] for group in groups])


def jackknife(estimate: Callable[[NDArray[np.bool_]], Array], of: NDArray[np.int64]) -> Spread:
    """Spread of an estimate by leaving out one cluster at a time.

    Parameters
    ----------
    estimate : callable
        Boolean array [records] of those to keep -> Array [estimates].
    of : NDArray[int64] [records]
        Cluster of each record, at least two distinct.

    Returns
    -------
    Spread
    """
    names = np.unique(of)
    without = np.array([estimate(of != name) for name in names])
    count = len(names)
    variance = (count - 1) / count * np.sum((without - without.mean(axis=0)) ** 2, axis=0)
    return Spread(variance, np.full(variance.shape, count - 1.0))
