"""Information criteria of fitted curves whose residuals are autocorrelated.

CurveFit --independent residuals--> AICc, BIC (overconfident, since residuals of a run are autocorrelated)
         --AR(1) errors, refitted--> AICc, BIC that account for autocorrelation

Sources: Hurvich and Tsai 1989, DOI 10.1093/biomet/76.2.297 (AICc); Schwarz 1978, DOI 10.1214/aos/1176344136 (BIC);
Cochrane and Orcutt 1949, DOI 10.1080/01621459.1949.10483290 (autocorrelated errors).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.degradation_models import CurveFit, polished, whitened

Array = NDArray[np.float64]

LONGEST_MEMORY = 0.99
"""Largest correlation of neighbouring residuals; at 1 the level of the curve would be undetermined."""


@dataclass(frozen=True)
class Criteria:
    """Information criteria of a fit: lower is better, and only differences between models matter.

    Parameters
    ----------
    aicc, bic : float
        Criteria with independent residuals.
    aicc_ar1, bic_ar1 : float
        Criteria with residuals as an AR(1) process, whose correlation counts as a parameter.
    memory : float
        Correlation of neighbouring residuals of the least-squares fit.
    memory_ar1 : float
        The same correlation for the refitted curve.
    """

    aicc: float
    bic: float
    aicc_ar1: float
    bic_ar1: float
    memory: float
    memory_ar1: float


def memory_of(residuals: Array) -> float:
    """Correlation of neighbouring residuals about zero, limited to +-0.99; 0 where all residuals are 0."""
    power = float(np.sum(residuals**2))
    if power <= 0:
        return 0.0
    rho = float(np.sum(residuals[1:] * residuals[:-1])) / power
    return min(max(rho, -LONGEST_MEMORY), LONGEST_MEMORY)


def criteria(fit: CurveFit) -> Criteria:
    """AICc and BIC of a fit, with independent residuals and with AR(1) residuals.

    Parameters
    ----------
    fit : CurveFit
        A least-squares fit. For a robust fit, criteria are those of its curve under the normal law.

    Returns
    -------
    Criteria
        Rows are assumed evenly spaced. An exact fit has -inf.

    Notes
    -----
    With AR(1) errors the curve is refitted to whitened values and the correlation is estimated again, until the
    likelihood no longer increases. Variance is assumed constant along the run, although a failing bearing scatters
    more.
    """
    n = fit.values.size
    parameters = fit.model.parameters
    residuals = fit.residuals
    independent = _deviance(residuals, 0.0)
    memory = memory_of(residuals)
    with_memory, rho_best = _deviance(residuals, memory), memory
    size = float(np.abs(fit.values).max())
    if size > 0:
        u, y = fit.scaled(fit.time_s), fit.values / size
        p, rho, linear = np.concatenate([fit.coefficients / size, fit.exponents]), memory, fit.model.linear
        for _ in range(8):
            p = polished(fit.model, u, y, p, memory=rho)
            left = y - fit.model.curve(u, p[:linear], tuple(p[linear:]))
            rho = memory_of(left)
            deviance = _deviance(left * size, rho)
            if deviance < with_memory:
                gained = with_memory - deviance
                with_memory, rho_best = deviance, rho
                if gained > 1e-3:
                    continue
            break
    free, free_ar1 = parameters + 1, parameters + 2
    return Criteria(
        _aicc(independent, free, n), independent + free * math.log(n),
        _aicc(with_memory, free_ar1, n), with_memory + free_ar1 * math.log(n), memory, rho_best,
    )  # fmt: skip


def _deviance(residuals: Array, memory: float) -> float:
    """-2 log likelihood of normal residuals at the maximum-likelihood variance."""
    n = residuals.size
    variance = float(np.mean(whitened(residuals, memory) ** 2))
    if variance <= 0:
        return -math.inf
    return n * (math.log(2 * math.pi * variance) + 1) - math.log(1 - memory**2)


def _aicc(deviance: float, free: int, n: int) -> float:
    left = n - free - 1
    return deviance + 2 * free + (2 * free * (free + 1) / left if left > 0 else math.inf)
