"""Laws of the life of bearings of one kind, and the remaining life that follows from the life so far.

lives of ended runs --predictive law--> LogNormal ---+
                    --a kernel at each life----------+--> Mixture --given the life so far--> quantiles of the rest

Lives of one kind often form groups, for instance by what fails. A single log-normal law is then too wide, and its
median lies between the groups. A kernel at each life follows them, and the log-normal law keeps the weight of two runs,
for lives unlike any so far (as the posterior predictive law of a Dirichlet process, Ferguson 1973, DOI
10.1214/aos/1176342360).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp, ndtri_exp

Array = NDArray[np.float64]

QUANTILES: Final = (0.05, 0.5, 0.95)
"""Shares of the 90 % interval and the median."""
FEWEST_WITH_KERNELS: Final = 4
"""Fewest lives with kernels; with fewer, groups are chance."""
BANDWIDTHS: Final = (0.2, 0.3, 0.5, 0.7)
"""Standard deviations of a kernel in log life that are compared; a smaller least one narrows intervals, which then miss
lives of the same group as those of few runs."""
_SPREAD: Final = 0.7
"""Prior standard deviation of log life over bearings of one kind, with the weight of two runs. A Weibull life of slope
1.5 (rolling bearings: 1.1 to 1.5) has 0.85, one of slope 2 has 0.64. Larger gives wider laws from few runs."""
_WEIGHT: Final = 2.0
"""Weight of the log-normal law beside the kernels, in runs; larger expects more lives unlike those so far."""
_GRID: Final = np.linspace(-14.0, 7.0, 512)
"""Log remaining lives, relative to the typical life, between which quantiles of mixtures are interpolated."""


@dataclass(frozen=True)
class LogNormal:
    """Log-normal law of a number of revolutions: mean and standard deviation of its natural logarithm."""

    mean: float
    std: float

    def remaining(self, revolutions: float, shares: Sequence[float] = QUANTILES) -> tuple[float, ...]:
        """Quantiles of the remaining life, given that life is longer than `revolutions`."""
        lived = max(revolutions, 1e-9)
        beyond = log_ndtr((self.mean - np.log(lived)) / self.std)
        ends = np.exp(self.mean - self.std * ndtri_exp(beyond + np.log1p(-np.asarray(shares, float))))
        return tuple(float(v) for v in np.maximum(ends - revolutions, 0.0))

    def log_density(self, log_life: Array) -> Array:
        """Logarithm of the density of log life at values [...]."""
        return np.asarray(-0.5 * ((log_life - self.mean) / self.std) ** 2 - np.log(self.std * np.sqrt(2 * np.pi)))


@dataclass(frozen=True)
class Mixture:
    """Kernels at the lives of ended runs, and a log-normal law for lives unlike these.

    Parameters
    ----------
    usual : LogNormal
        Weighs as much as two kernels.
    logs : tuple of float
        Logarithms of the lives.
    bandwidth : float
        Standard deviation of a kernel.
    """

    usual: LogNormal
    logs: tuple[float, ...]
    bandwidth: float

    @property
    def mean(self) -> float:
        """Mean of log life."""
        return self.usual.mean

    @property
    def std(self) -> float:
        """Standard deviation of log life by the log-normal law."""
        return self.usual.std

    def _parts(self) -> tuple[Array, Array, Array]:
        """Means, standard deviations and log weights of all components."""
        means = np.array([*self.logs, self.usual.mean])
        stds = np.array([self.bandwidth] * len(self.logs) + [self.usual.std])
        weights = np.array([1.0] * len(self.logs) + [_WEIGHT])
        return means, stds, np.log(weights / weights.sum())

    def remaining(self, revolutions: float, shares: Sequence[float] = QUANTILES) -> tuple[float, ...]:
        """Quantiles of the remaining life, given that life is longer than `revolutions`."""
        means, stds, weights = self._parts()
        left = np.exp(_GRID + max(self.usual.mean, np.log(max(revolutions, 1e-9))))

        def beyond(life: Array) -> Array:
            return np.asarray(logsumexp(log_ndtr((means - np.log(life)[:, None]) / stds) + weights, axis=1))

        alive = float(beyond(np.array([max(revolutions, 1e-9)]))[0])
        ended = alive - beyond(revolutions + left)
        found = np.exp(np.interp(-np.log1p(-np.asarray(shares, float)), ended, np.log(left)))
        return tuple(float(v) for v in found)

    def log_density(self, log_life: Array) -> Array:
        """Logarithm of the density of log life at values [...]."""
        means, stds, weights = self._parts()
        z = (np.asarray(log_life, float)[..., None] - means) / stds
        return np.asarray(logsumexp(-0.5 * z**2 - np.log(stds * np.sqrt(2 * np.pi)) + weights, axis=-1))


LifeLaw = LogNormal | Mixture


def log_normal(lives: Sequence[float]) -> LogNormal:
    """Predictive log-normal law of the next life: standard deviation times sqrt(1 + 1/n)."""
    logs = np.log(lives)
    squares = float(np.sum((logs - logs.mean()) ** 2)) + 2 * _SPREAD**2
    return LogNormal(float(logs.mean()), float(np.sqrt(squares / (logs.size + 1) * (1 + 1 / logs.size))))


def law_of(lives: Sequence[float]) -> LifeLaw:
    """Law of the next life.

    Parameters
    ----------
    lives : sequence of float
        Revolutions of ended runs, positive.

    Returns
    -------
    LogNormal or Mixture
        A mixture from `FEWEST_WITH_KERNELS` lives on. Its bandwidth is the one with the highest likelihood of each life
        by the law of the others.
    """
    if len(lives) < FEWEST_WITH_KERNELS:
        return log_normal(lives)
    logs = tuple(float(v) for v in np.log(lives))
    others = [(log_normal([*lives[:place], *lives[place + 1 :]]), (*logs[:place], *logs[place + 1 :]))
              for place in range(len(logs))]  # fmt: skip

    def likelihood(bandwidth: float) -> float:
        each = zip(others, logs, strict=True)
        return sum(float(Mixture(usual, rest, bandwidth).log_density(np.array(own))) for (usual, rest), own in each)

    return Mixture(log_normal(lives), logs, max(BANDWIDTHS, key=likelihood))
