"""Local maxima of a curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def highest(values: Array, most: int) -> NDArray[np.int64]:
    """Places of at most `most` local maxima, the highest first, ends included."""
    padded = np.concatenate(([-np.inf], values, [-np.inf]))
    tops = np.flatnonzero((values >= padded[:-2]) & (values > padded[2:]))
    return np.asarray(tops[np.argsort(-values[tops])[:most]])
