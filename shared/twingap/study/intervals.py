"""Exact confidence intervals of rates and medians, valid for few worlds.

k of n --Clopper-Pearson--> interval of a rate;  values --order statistics--> interval of their median
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

LEVEL = 0.95
"""Confidence level of all intervals: a higher one widens them."""


def of_rate(k: int, n: int) -> tuple[float, float]:
    """Clopper-Pearson interval of a rate of k in n trials, of at least the nominal coverage for any true rate.

    It is (0, 1) for n = 0; a k that is negative or larger than n is a ValueError.

    References
    ----------
    C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial,
    Biometrika 26 (1934) 404, doi:10.1093/biomet/26.4.404.
    """
    from scipy.stats import beta

    if not 0 <= k <= n:
        raise ValueError(f"{k} of {n}")
    tail = (1 - LEVEL) / 2
    low = float(beta.ppf(tail, k, n - k + 1)) if k > 0 else 0.0
    high = float(beta.ppf(1 - tail, k + 1, n - k)) if k < n else 1.0
    return low, high


def of_median(values: Sequence[float]) -> tuple[float, float]:
    """Distribution-free interval of the median from independent values, by order statistics.

    Infinite where there are too few values for the level (fewer than six at 95 %).

    References
    ----------
    H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed. 2003, sec. 7.1.
    """
    from scipy.stats import binom

    ordered = np.sort(np.asarray(values, float))
    n = ordered.size
    # The largest r with P(Binomial(n, 1/2) < r) <= tail.
    r = int(binom.ppf((1 - LEVEL) / 2, n, 0.5)) if n else 0
    while r > 0 and binom.cdf(r - 1, n, 0.5) > (1 - LEVEL) / 2:
        r -= 1
    if r < 1:
        return -math.inf, math.inf
    return float(ordered[r - 1]), float(ordered[n - r])
