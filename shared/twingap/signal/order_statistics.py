"""Order statistics at a few ranks without a full sort.

samples --leading bits of each--> bins in ascending order --counts--> the bins that hold a rank --sorted--> its sample

Doubles of one sign ascend as their bits do, so bins of equal leading bits (1/64 of an octave) require no knowledge of
the distribution. There are three passes over the samples; only the samples in the bins of the ranks are sorted.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit

Array = NDArray[np.float64]

_SHIFT: Final = 46
"""Low bits of a double that bins ignore: 6 of the mantissa's 52 are kept; a smaller shift gives more, smaller bins."""
_DEEPEST: Final = 24 << (52 - _SHIFT)
"""Bins of either sign: values more than 24 octaves below the largest share one bin about 0."""
_MAGNITUDE: Final = (1 << 63) - 1


def order_statistics(x: Array, ranks: NDArray[np.int64]) -> Array:
    """Order statistics: the same as ``np.sort(x)[ranks]``.

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
    samples, ranks = np.ascontiguousarray(x, float), np.ascontiguousarray(ranks, np.int64)
    bin_of, begins = np.empty(samples.size, np.int32), np.zeros(2 * _DEEPEST + 2, np.int64)
    offset, held = np.zeros(2 * _DEEPEST + 1, np.int64), np.empty(samples.size)
    place = np.empty(ranks.size, np.int64)
    total = _gathered(samples, samples.view(np.int64), ranks, bin_of, begins, offset, held, place)
    return np.asarray(np.sort(held[:total])[place])


@njit()
def _gathered(x, bits, ranks, bin_of, begins, offset, held, place):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Number of samples in bins that hold a rank; `held` begins with them, `place` is each rank's index once sorted.

    `begins` and `offset` are zeros; `bin_of` is work space.
    """
    largest = 0
    for i in range(bits.size):
        magnitude = bits[i] & _MAGNITUDE
        largest = magnitude if magnitude > largest else largest
    zero = (largest >> _SHIFT) - _DEEPEST
    for i in range(x.size):
        own = ((bits[i] & _MAGNITUDE) >> _SHIFT) - zero
        own = 0 if own < 0 else own
        own = _DEEPEST + (own if bits[i] >= 0 else -own)
        bin_of[i] = own
        begins[own + 1] += 1
    for k in range(1, begins.size):  # rank of the first sample of each bin
        begins[k] += begins[k - 1]
    for k in range(ranks.size):
        low, high = 0, begins.size - 1  # begins[low] <= rank < begins[high]
        while high - low > 1:
            middle = (low + high) // 2
            if begins[middle] <= ranks[k]:
                low = middle
            else:
                high = middle
        place[k] = low
        offset[low] = 1
    total = 0
    for k in range(offset.size):
        if offset[k]:
            offset[k] = total + 1  # 0 marks bins without a rank
            total += begins[k + 1] - begins[k]
    for k in range(ranks.size):
        place[k] = offset[place[k]] - 1 + ranks[k] - begins[place[k]]
    for i in range(x.size):
        own = bin_of[i]
        if offset[own]:
            held[offset[own] - 1] = x[i]
            offset[own] += 1
    return total
