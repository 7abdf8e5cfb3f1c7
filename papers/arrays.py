"""The type of most arrays, and places spread over them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def spread(count: int, most: int) -> NDArray[np.int64]:
    """At most so many places of `count`, evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
