"""Least-squares fits of sums of known shapes to mean spectra, with relative errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def least_misfit(basis: Array, wanted: Array) -> tuple[float, Array]:
    """Of sums of spectra `basis` [choices, spectra, bands]: least mean square log ratio of `wanted`, and its powers.

    Powers [spectra] minimise the relative errors; choices with a negative power have an infinite misfit.
    """
    a = basis / wanted
    size = np.sqrt((a**2).sum(axis=2, keepdims=True)) + 1e-300
    a = a / size
    square = a @ a.transpose(0, 2, 1) + 1e-9 * np.eye(basis.shape[1])
    powers = np.linalg.solve(square, a.sum(axis=2)[:, :, None])[:, :, 0]
    rest = np.log(np.maximum(np.einsum("cs,csb->cb", powers, a), 1e-6))
    misfit = np.where((powers >= 0).all(axis=1), np.minimum(rest**2, 1.0).mean(axis=1), np.inf)
    best = int(np.argmin(misfit))
    found = powers[best] / size[best, :, 0]
    return float(misfit[best]), found if np.isfinite(misfit[best]) else np.zeros(basis.shape[1])


def misfit_of_modes(modes: Array, white: Array, wanted: Array) -> float:
    """Least mean square log ratio of `wanted` [bands] to sums of a row of `modes` [modes, bands] and of white noise."""
    weight = 1 / wanted
    a, b = modes * weight, white * weight
    aa, ab, bb = (a * a).sum(axis=1), a @ b, float(b @ b)
    sa, sb = a.sum(axis=1), float(b.sum())
    determinant = np.maximum(aa * bb - ab**2, 1e-300)
    structure, noise = (sa * bb - sb * ab) / determinant, (sb * aa - sa * ab) / determinant
    # Powers are non-negative: where one would be negative, the other is fitted alone.
    structure, noise = (
        np.where(noise < 0, sa / aa, np.maximum(structure, 0.0)),
        np.where(structure < 0, sb / bb, np.maximum(noise, 0.0)),
    )
    model = structure[:, None] * a + noise[:, None] * b
    return float(np.minimum(np.log(np.maximum(model, 1e-6)) ** 2, 1.0).mean(axis=1).min())


def misfit_at_any_level(model: Array, wanted: Array) -> float:
    """Mean square log ratio of `wanted` [bands] to `model` [bands] at its best level (median)."""
    rest = np.log(wanted / model)
    return float(np.minimum((rest - np.median(rest)) ** 2, 1.0).mean())
