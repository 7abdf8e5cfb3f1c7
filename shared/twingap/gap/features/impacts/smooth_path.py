"""Evidence for a second impact on a defect where the transmission path's gain may be any smooth curve.

ln of measured over simulated power of harmonics --covariance of a smooth path, most likely length and size-->
    whitened, straight lines taken out --each comb |1 + r exp(i k a)|^2 whitened alike--> log likelihood ratio

A twin whose mode is slightly misplaced leaves a ratio that bends over some harmonics, as a comb of few teeth does. The
covariance of an Ornstein-Uhlenbeck process models such bends; a comb that goes on over all harmonics stands out of it.
Generalised least squares (Aitken 1935, doi:10.1017/S0370164600014346).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from twingap.records import Array

_LENGTHS: Final = (1.5, 4.0, 10.0)
"""Correlation lengths of the path that are tried, harmonics."""
_SIZES: Final = (0.2, 1.0, 4.0, 16.0, 64.0)
"""Variances of the path that are tried, over that of a harmonic of full weight."""
GRID: Final = 8
"""Delays per harmonic that are searched: combs are the sharper, the more harmonics there are."""
_FINEST: Final = 200
"""Harmonics up to which the grid of delays gets finer. More are finer and slower."""
CANDIDATES: Final = 12
"""Delays of either sign for which the full comb is fitted: those where its first term is strongest."""
_LEAST: Final = 1e-3
"""Least mean square of a fit: keeps the logarithm finite."""


class OverHarmonics(NamedTuple):
    """Ratio of measured to simulated power over the harmonics of one fault, all [harmonics]."""

    log: Array  # ln of it
    weight: Array  # 0 to 1; 0 leaves a harmonic out
    noise: Array  # over power: fills the minima of a comb
    path: Array  # ln of the factor by which the path of the noise would change it; all equal where it is not known


def log_likelihood_ratios(over: OverHarmonics, ratios: Array, least_part: float) -> Array:
    """[2, ratios] Log likelihood ratio of the best comb of each ratio of second impact to first, over none.

    With the sign of the first impact, and with the other. `least_part` is the shortest delay, parts of a pass; the
    longest is half of one.
    """
    log, weight, noise, path = over
    seen = np.flatnonzero(weight)
    harmonic = np.asarray(seen + 1.0, float)
    smooth = [np.ones(seen.size), harmonic / weight.size]
    if np.ptp(path[seen]) > 0:
        smooth.append(path[seen])
    root, basis, target = _whitened(
        np.column_stack((log[seen], *smooth)), np.asarray(1 / weight[seen], float), harmonic
    )
    rest = float(target @ target) + _LEAST * seen.size

    def held(curves: Array) -> Array:
        """[harmonics, curves] Whitened, what is smooth taken out."""
        white = solve_triangular(root, curves, lower=True, check_finite=False)
        return np.asarray(white - basis @ (basis.T @ white))

    parts = np.arange(least_part, 0.5, 1 / (GRID * min(weight.size, _FINEST)))
    # ln |1 + r exp(i k a)|^2 = 2 r cos(k a) - ...: delays where the first term is strong.
    first = held(np.cos(2 * np.pi * np.outer(harmonic, parts)))
    strong = (target @ first) / np.sqrt(np.maximum((first**2).sum(axis=0), 1e-12))
    out = np.zeros((2, ratios.size))
    for row, sign in enumerate((1.0, -1.0)):
        at = parts[highest(sign * strong, CANDIDATES)]
        phase = np.exp(2j * np.pi * np.outer(harmonic, at))
        for column, ratio in enumerate(ratios):
            combs = held(np.log(np.abs(1 + sign * ratio * phase) ** 2 + noise[seen, None]))
            left = ((target[:, None] - combs) ** 2).sum(axis=0) + _LEAST * seen.size
            out[row, column] = 0.5 * seen.size * math.log(rest / float(left.min()))
    return out


def highest(values: Array, most: int) -> NDArray[np.int64]:
    """Places of at most `most` local maxima, the highest first, ends included."""
    padded = np.concatenate(([-np.inf], values, [-np.inf]))
    tops = np.flatnonzero((values >= padded[:-2]) & (values > padded[2:]))
    return np.asarray(tops[np.argsort(-values[tops])[:most]])


def _whitened(columns: Array, variance: Array, harmonic: Array) -> tuple[Array, Array, Array]:
    """Root of the most likely covariance, an orthogonal basis of what is smooth, and what is left of the first column,
    both whitened by it."""
    apart = np.abs(harmonic[:, None] - harmonic)
    best: tuple[float, Array, Array, Array] | None = None
    for length, size in ((1.0, 0.0), *((a, s) for a in _LENGTHS for s in _SIZES)):
        root = np.linalg.cholesky(np.diag(variance) + size * np.exp(-apart / length))
        white = solve_triangular(root, columns, lower=True, check_finite=False)
        basis, _ = np.linalg.qr(white[:, 1:])
        target = white[:, 0] - basis @ (basis.T @ white[:, 0])
        mean = float(target @ target) / target.size + _LEAST
        likelihood = -0.5 * target.size * math.log(mean) - float(np.log(np.diag(root)).sum())
        if best is None or likelihood > best[0]:
            best = likelihood, np.asarray(root), np.asarray(basis), np.asarray(target)
    assert best is not None
    return best[1:]
