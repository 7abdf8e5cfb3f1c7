"""A few order statistics of many samples, without sorting them.

samples --leading bits of each--> bins in ascending order --counts--> the bins that hold a rank --sorted--> its sample

Doubles of one sign ascend as their bits do, so that bins of equal leading bits (1/64 of an octave) need no knowledge of
the distribution. Three passes over the samples; of what they fall into, only a few dozen are sorted.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SHIFT: Final = 46
"""Bits of a double's mantissa that bins do not tell apart: 6 of 52 are kept."""
_DEEPEST: Final = 24 << (52 - _SHIFT)
"""Bins of either sign: what is more than 24 octaves below the largest falls into one bin about 0."""
_MAGNITUDE: Final = (1 << 63) - 1


def order_statistics(x: Array, ranks: NDArray[np.int64]) -> Array:
    """The same as ``np.sort(x)[ranks]``.

    Parameters
    ----------
    x : Array [samples]
        Finite.
    ranks : Array [ranks]
        From 0 to samples - 1, in any order.

    Returns
    -------
    Array [ranks]
    """
    samples = np.ascontiguousarray(x, float)
    return np.asarray(_selected(samples, samples.view(np.int64), np.asarray(ranks, np.int64)))


@njit(cache=True, nogil=True)
def _selected(x, bits, ranks):  # type: ignore[no-untyped-def]  # pragma: no cover
    largest = 0
    for i in range(bits.size):
        largest = max(largest, bits[i] & _MAGNITUDE)
    zero = (largest >> _SHIFT) - _DEEPEST
    bin_of, begins = np.empty(x.size, np.int32), np.zeros(2 * _DEEPEST + 2, np.int64)
    for i in range(x.size):
        own = max(((bits[i] & _MAGNITUDE) >> _SHIFT) - zero, 0)
        bin_of[i] = _DEEPEST + (own if bits[i] >= 0 else -own)
        begins[bin_of[i] + 1] += 1
    for k in range(1, begins.size):  # of each bin, the rank of its first
        begins[k] += begins[k - 1]
    place, total = np.full(begins.size - 1, -1), 0
    of_rank = np.empty(ranks.size, np.int64)
    for k in range(ranks.size):
        of_rank[k] = np.searchsorted(begins, ranks[k], side="right") - 1
        if place[of_rank[k]] < 0:
            place[of_rank[k]] = total
            total += begins[of_rank[k] + 1] - begins[of_rank[k]]
    held, end = np.empty(total), place.copy()
    for i in range(x.size):
        own = bin_of[i]
        if place[own] >= 0:
            held[end[own]] = x[i]
            end[own] += 1
    out = np.empty(ranks.size)
    for k in range(ranks.size):
        own = of_rank[k]
        here = held[place[own] : end[own]]
        here.sort()
        out[k] = here[ranks[k] - begins[own]]
    return out
