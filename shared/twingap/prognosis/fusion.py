"""Feature fusion by principal components, fitted on the healthy beginning of a run or on all rows.

features [rows, features] --centre, scale--> normalised --principal axes--> fusion features 1, 2, ... [rows, features]
     centre, scale and axes are fitted on healthy rows (online) or on all rows (as in the paper, offline)

Paper 2 normalises 15 features and fuses them by PCA of the complete run, so that the indicator at a row depends on
later rows and cannot be used online. Fitted on healthy rows, `Fusion` can. Fusion features are numbered in descending
order of variance, as by `pca` of MATLAB, unless `order` states otherwise.
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
"""Range relative to size below which a feature counts as constant; rounding of sums gives about 1e-12."""
ROUNDING = 1e-10
"""Variance along an axis, relative to the largest, below which it counts as zero."""


@dataclass(frozen=True)
class Fusion:
    """Centre, scale and principal axes of features.

    Parameters
    ----------
    centre, scale : Array [features]
        A feature x is normalised to (x - centre) / scale.
    axes : Array [components, features]
        Axes of unit length. The sign, which PCA leaves open, makes the largest entry positive.
    variance : Array [components]
        Variance of the rows of the fit along each axis.
    """

    centre: Array
    scale: Array
    axes: Array
    variance: Array

    def normalised(self, features: ArrayLike) -> Array:
        """Normalised features [rows, features]."""
        return np.asarray((np.asarray(features, float) - self.centre) / self.scale)

    def fused(self, features: ArrayLike) -> Array:
        """Fusion features [rows, components]; rows do not depend on each other."""
        return np.asarray(self.normalised(features) @ self.axes.T)


def learn_fusion(rows: ArrayLike, *, scaling: Scaling = "z", order: Order = "descending") -> Fusion:
    """Normalisation and principal axes of these rows.

    Parameters
    ----------
    rows : array_like [rows, features]
        Rows of the fit: the healthy start for an online indicator.
    scaling : {"z", "range"}
        Mean and standard deviation, or minimum and range.
    order : {"descending", "ascending"}
        Order of variance from component 1 on.

    Returns
    -------
    Fusion
        As many components as features, or fewer where features are linearly dependent.

    Raises
    ------
    TwingapError
        For NaN, fewer than 3 rows, or a constant feature.
    """
    x = np.asarray(rows, float)
    if x.ndim != 2 or x.shape[0] < 3:
        raise TwingapError(f"shape {x.shape}, at least 3 rows of features expected", where="fusion")
    if not np.isfinite(x).all():
        raise TwingapError("contains NaN or infinity", where="fusion", mend="leave these rows out")
    flat = np.flatnonzero(constant(x))
    if flat.size:
        numbers = ", ".join(str(k + 1) for k in flat)
        raise TwingapError(
            f"feature {numbers} does not vary in the {x.shape[0]} rows of the fit", where="fusion",
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
    # Linearly dependent features give axes along which the variance is only rounding.
    real = variance > ROUNDING * variance[-1]
    variance, axes = variance[real], axes[real]
    if order == "descending":
        variance, axes = variance[::-1], axes[::-1]
    largest = np.abs(axes).argmax(axis=1)
    axes = axes * np.sign(axes[np.arange(len(axes)), largest])[:, None]
    return Fusion(centre, scale, np.ascontiguousarray(axes), variance)


def constant(rows: ArrayLike) -> NDArray[np.bool_]:
    """Whether features [features] are constant in rows [rows, features], except for rounding."""
    x = np.asarray(rows, float)
    return np.asarray(np.ptp(x, axis=0) <= FLAT * np.abs(x).max(axis=0))
