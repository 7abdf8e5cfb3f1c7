"""Feature fusion by principal components, fitted on the healthy beginning of a run or on all of it.

features [rows, features] --centre, scale--> normalised --principal axes--> fusion features 1, 2, ... [rows, features]
     healthy rows only (online) or all rows (the paper's reading, offline) decide centre, scale and axes

Paper 2 normalises 15 features into a matrix and fuses them by PCA of the whole run: at any row its indicator depends on
rows that come later, so it describes a run and cannot watch one. `Fusion` learnt from healthy rows does both. Fusion
feature k is numbered from the greatest variance (MATLAB's `pca` and the textbook's order) unless `order` is another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError

Array = NDArray[np.float64]
Scaling = Literal["z", "range"]
Order = Literal["descending", "ascending"]

FLAT = 1e-9
"""Spread over size below which a feature counts as constant: rounding of sums leaves about 1e-12."""
ROUNDING = 1e-10
"""Variance along an axis, over that along the greatest, which is taken for none."""


@dataclass(frozen=True)
class Fusion:
    """Centre, scale and principal axes of features.

    Parameters
    ----------
    centre, scale : Array [features]
        A feature x is normalised to (x - centre) / scale.
    axes : Array [components, features]
        Of unit length, each with its largest entry positive: PCA leaves the sign open.
    variance : Array [components]
        Of the rows learnt from along each axis.
    """

    centre: Array
    scale: Array
    axes: Array
    variance: Array

    def normalised(self, features: ArrayLike) -> Array:
        """Features [rows, features] in units of the scale."""
        return np.asarray((np.asarray(features, float) - self.centre) / self.scale)

    def fused(self, features: ArrayLike) -> Array:
        """Fusion features [rows, components]; each row depends on no other."""
        return np.asarray(self.normalised(features) @ self.axes.T)


def learn_fusion(rows: ArrayLike, *, scaling: Scaling = "z", order: Order = "descending") -> Fusion:
    """Normalisation and principal axes of these rows.

    Parameters
    ----------
    rows : array_like [rows, features]
        Those to learn from: the healthy start for an indicator that is to run online.
    scaling : {"z", "range"}
        Mean and standard deviation, or least and range: both are called normalisation.
    order : {"descending", "ascending"}
        Of variance, from component 1 on.

    Returns
    -------
    Fusion
        With as many components as features, fewer where some follow from others.

    Raises
    ------
    TwingapError
        For NaN, fewer than 3 rows, or a feature that does not vary in them.
    """
    x = np.asarray(rows, float)
    if x.ndim != 2 or x.shape[0] < 3:
        raise TwingapError(f"shape {x.shape}, at least 3 rows of features expected", where="fusion")
    if not np.isfinite(x).all():
        raise TwingapError("holds NaN or infinity", where="fusion", mend="leave these rows out")
    flat = np.flatnonzero(constant(x))
    if flat.size:
        numbers = ", ".join(str(k + 1) for k in flat)
        raise TwingapError(
            f"feature {numbers} does not vary in the {x.shape[0]} rows learnt from", where="fusion",
            mend="leave it out or take more rows",
        )  # fmt: skip
    if scaling == "z":
        centre, scale = x.mean(axis=0), x.std(axis=0, ddof=1)
    else:
        centre, scale = x.min(axis=0), np.ptp(x, axis=0)
    z = (x - centre) / scale
    covariance = np.cov(z, rowvar=False, ddof=1).reshape(x.shape[1], x.shape[1])
    variance, vectors = np.linalg.eigh(covariance)
    axes = vectors.T
    # Features that follow from one another leave axes along which there is nothing but rounding.
    real = variance > ROUNDING * variance[-1]
    variance, axes = variance[real], axes[real]
    if order == "descending":
        variance, axes = variance[::-1], axes[::-1]
    largest = np.abs(axes).argmax(axis=1)
    axes = axes * np.sign(axes[np.arange(len(axes)), largest])[:, None]
    return Fusion(centre, scale, np.ascontiguousarray(axes), variance)


def constant(rows: ArrayLike) -> NDArray[np.bool_]:
    """Which features [features] do not vary in rows [rows, features], but for rounding."""
    x = np.asarray(rows, float)
    return np.asarray(np.ptp(x, axis=0) <= FLAT * np.abs(x).max(axis=0))
