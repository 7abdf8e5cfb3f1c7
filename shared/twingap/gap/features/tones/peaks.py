"""Places where a curve is highest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def highest(values: Array, most: int) -> NDArray[np.int64]:
    """Places of the highest local maxima, at most so many, ends among them."""
    padded = np.concatenate(([-np.inf], values, [-np.inf]))
    tops = np.flatnonzero((values >= padded[:-2]) & (values > padded[2:]))
    return np.asarray(tops[np.argsort(-values[tops])[:most]])
