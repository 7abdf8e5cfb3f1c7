"""Encodings of a record's place in the run and of its speed, for a network (eq. 13).

Source: section 3.5 of paper 1, after Vaswani et al. 2017, Attention is all you need, arXiv:1706.03762.
"""

import numpy as np
from numpy.typing import ArrayLike

from papers.arrays import Array
from twingap import TwingapError

D_MODEL = 24  # length of each encoding (table 4)


def positional_encoding(position: ArrayLike, d_model: int = D_MODEL) -> Array:
    """PE(pos, 2i) = sin(pos / 10000^(2i / d_model)), PE(pos, 2i + 1) = cos of the same, positions from 1: eq. 13 [...,
    d_model]."""
    if d_model < 2 or d_model % 2:
        raise TwingapError(f"d_model = {d_model}, an even number of at least 2 expected", where="encoding")
    angle = np.asarray(position, float)[..., None] / 10000.0 ** (np.arange(0, d_model, 2) / d_model)
    return np.stack((np.sin(angle), np.cos(angle)), axis=-1).reshape(*angle.shape[:-1], d_model)


def speed_position(speed_rpm: ArrayLike, speeds_rpm: ArrayLike) -> Array:
    """Position of speeds [...] among the increasing operating speeds: that of the nearest, 1 for the lowest."""
    speed, known = np.asarray(speed_rpm, float), np.asarray(speeds_rpm, float)
    if known.ndim != 1 or known.size == 0 or (np.diff(known) <= 0).any():
        raise TwingapError("increasing speeds expected", where="operating speeds")
    middles = (known[1:] + known[:-1]) / 2
    return np.asarray(np.searchsorted(middles, speed, side="right"), float) + 1.0
