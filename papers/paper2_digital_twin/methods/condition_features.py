"""Hand-made features of a bearing's condition, for methods that learn from few records."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, Final

import numpy as np
from scipy import fft

from papers.arrays import Array
from papers.paper2_digital_twin.methods.scalograms import ImageOptions, Modulation
from twingap import Bearing
from twingap.signal.features import time_features

BANDS: Final = 8  # equal bands from 0 to half the sampling rate
SHAPES: Final = ("kurtosis", "crest_factor", "shape_factor", "impulse_factor", "clearance_factor")
FAULTS: Final = ("inner", "outer", "ball")
WINDOW_FEATURES: Final = (
    "log_std", *(f"log_{name}" for name in SHAPES), *(f"log_band_{i}" for i in range(BANDS))
)  # fmt: skip
PIECE_FEATURES: Final = (*WINDOW_FEATURES, *(f"lines_{fault}" for fault in FAULTS), "unordered")
_TOLERANCE = 0.02
_HARMONICS = 2


def window_features(x: Array, level: Callable[..., Any] = np.mean) -> Array:
    """`WINDOW_FEATURES` [windows, features] of windows x [windows, samples] without mean: logarithms of level, shape
    and level in bands, since a fault multiplies them, and so does a machine's size.

    `level` is of the power of a band's lines; the median passes over (electrical) tones and moves with what impacts
    excite.
    """
    centred = x - x.mean(axis=-1, keepdims=True)
    tiny = np.finfo(np.float64).tiny
    table = time_features(centred)
    power = np.abs(fft.rfft(centred * np.hanning(x.shape[-1]), axis=-1)) ** 2
    edges = np.linspace(0, power.shape[-1], BANDS + 1).round().astype(int)
    bands = np.stack([level(power[:, a:b], axis=-1) for a, b in pairwise(edges)], axis=-1)
    shapes = np.stack([table[name] for name in ("std", *SHAPES)], axis=-1)
    return np.concatenate((np.log(np.maximum(shapes, tiny)), np.log(np.maximum(bands, tiny)) / 2), axis=-1)


def line_features(found: Modulation, bearing: Bearing, options: ImageOptions) -> Array:
    """How far each fault's order stands out (log10 prominence of harmonics, mean over the two carriers in which it is
    largest), and the same mean of the rows' median over Gaussian noise [pieces, 4]."""
    lines, orders = found.lines, options.orders
    floor = np.median(lines, axis=-1)
    columns = []
    for fault in FAULTS:
        heights = []
        for harmonic in range(1, _HARMONICS + 1):
            order = harmonic * bearing.fault_order(fault)
            near = np.abs(orders - order) <= max(_TOLERANCE * order, 0.5 / options.turns)
            if near.any():
                heights.append(np.log10(lines[..., near].max(axis=-1) / floor))
        columns.append(_top(np.mean(heights, axis=0)))
    columns.append(_top(np.log10(floor)))
    return np.stack(columns, axis=-1)


def _top(rows: Array) -> Array:
    return np.asarray(np.sort(rows, axis=-1)[..., -2:].mean(axis=-1))
