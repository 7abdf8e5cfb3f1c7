"""Test of whether one twin is closer to held-out records than another, by random signs.

squared distance of each record to both twins --difference, mean of a group--> sign flips --> p-value
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.stats import permutation_test

from twingap.gap.distance.paired import Paired, compressed
from twingap.records import Array

_DRAWS: Final = 9999
"""Largest number of sign flips of a test. A larger number resolves smaller p-values."""


def p_of_gain(before: Paired, after: Paired, root: int) -> float:
    """P-value of records being no closer to a second twin than to a first one; 1 where there are fewer than two groups.

    Both pairs are of the same records, on one scale. Signs of the differences in squared distance are flipped group by
    group; `root` is the entropy of the flips.
    """
    gain = squared_distances(before) - squared_distances(after)
    groups = np.array([c.group or c.name for c in before.conditions])
    means = np.array([gain[groups == group].mean() for group in dict.fromkeys(groups)])
    if len(means) < 2 or not np.ptp(np.abs(means)):
        return 1.0
    found = permutation_test(
        (means,), np.mean, permutation_type="samples", alternative="greater", n_resamples=_DRAWS,
        rng=np.random.default_rng([root % 2**32, len(means)]),
    )  # fmt: skip
    return float(found.pvalue)


def squared_distances(pair: Paired) -> Array:
    """[records] Squared distance of each record from the mean of its simulations, over all domains."""
    return np.asarray(compressed((pair.difference / pair.scale) ** 2) @ pair.real.weight)
