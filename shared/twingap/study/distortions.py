"""Distorted-simulator tests: is the twin distorted by a just detectable amount of one of the effects?

training worlds --no effect--> whitened statistics, N(0, 1)
                --effect i---> shifts --times the amplitude that is just detectable--> likelihood ratio t_i
blind world --t_i of all effects--> largest, against worlds without effects --> p-value; best fit --> Found

N. Anau Montel, J. Alvey, C. Weniger, Tests for model misspecification in simulation-based inference: from local
distortions to global model checks, Phys. Rev. D 111 (2025) 083013, arXiv:2412.15100. There, networks learn the ratios
from distorted data; here, distortions act on summary statistics, whose densities are Gaussian to a good approximation.
An error model on each summary statistic (spike and slab: D. Ward, P. Cannon, M. Beaumont, M. Fasiolo, S. M. Schmon,
Robust neural posterior estimation and statistical model criticism, NeurIPS 2022, arXiv:2210.06564) tells which
statistics disagree. Distortions by effects tell by what.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array
from twingap.study.rivals import Examples, Filled, Rival
from twingap.study.verdicts import Found

LEVEL: Final = 0.05
"""Level of the test, and of each effect's test for its just detectable amplitude; larger claims more gaps."""
POWER: Final = 0.5
"""Power at which an amplitude is just detectable; larger makes distortions stronger and the test less local."""
COMPONENTS: Final = 40
"""Principal components of the whitened statistics; more keep more detail and need more training worlds."""
FOLDS: Final = 5
"""Folds of the worlds without effects; more calibrate p-values more finely and are slower."""
FEWEST: Final = 8
"""Fewest worlds with an effect from which its distortion is estimated; more leave out more effects."""
STRONGER: Final = 2.0 ** np.arange(0, 7)
"""Multiples of the just detectable amplitude that are fitted; more reach stronger effects."""


@dataclass(frozen=True)
class Distortion:
    """Gaussian shift of the whitened statistics by one effect."""

    mean: Array  # [components] mean shift at amplitude 1, the strength in training
    axes: Array  # [components, directions] orthonormal directions in which the shift varies between machines
    variance: Array  # [directions] its variance along these, at amplitude 1

    @classmethod
    def of(cls, shifts: Array) -> Distortion:
        """Mean and covariance of shifts [worlds, components], less the noise of variance 1 that they contain."""
        mean = shifts.mean(axis=0)
        _, size, axes = np.linalg.svd((shifts - mean) / np.sqrt(len(shifts)), full_matrices=False)
        variance = size**2 - 1
        return cls(mean, axes[variance > 0].T, variance[variance > 0])

    def ratio(self, x: Array, amplitude: float) -> Array:
        """[worlds] Twice the log ratio of the likelihoods of x [worlds, components] with and without the distortion."""
        rest = x - amplitude * self.mean
        extra = amplitude**2 * self.variance
        fitted = (extra / (1 + extra) * (rest @ self.axes) ** 2).sum(axis=1)
        return np.asarray((x**2).sum(axis=1) - (rest**2).sum(axis=1) + fitted - np.log1p(extra).sum())

    def just_detectable(self, null: Array, shifts: Array, rng: np.random.Generator) -> float:
        """Amplitude at which a test of level `LEVEL` finds the distortion with probability `POWER`."""
        added = shifts[rng.integers(0, len(shifts), len(null))]
        low, high = 1e-4, 1.0
        while high / low > 1.1:
            middle = float(np.sqrt(low * high))
            bound = np.quantile(self.ratio(null, middle), 1 - LEVEL)
            found = np.mean(self.ratio(null + middle * added, middle) > bound)
            low, high = (middle, high) if found < POWER else (low, middle)
        return high


class _Fitted:
    """Whitening and distortions from one set of examples."""

    def __init__(self, x: Array, present: NDArray[np.bool_], rng: np.random.Generator) -> None:
        from sklearn.covariance import LedoitWolf

        without = ~present.any(axis=1)
        self.fill = Filled(x)
        ready = self.fill(x)
        covariance = LedoitWolf().fit(ready[without])
        values, axes = np.linalg.eigh(covariance.covariance_)
        self.middle, self.whiten = ready[without].mean(axis=0), axes / np.sqrt(values)
        white = (ready - self.middle) @ self.whiten
        _, _, principal = np.linalg.svd(white[~without], full_matrices=False)
        self.whiten = self.whiten @ principal[:COMPONENTS].T
        z = self(x)
        self.tests: dict[int, tuple[Distortion, float]] = {}
        for place in range(present.shape[1]):
            own = present[:, place]
            alone = own & (present.sum(axis=1) == 1)
            shifts = z[alone if alone.sum() >= FEWEST else own]
            if len(shifts) >= FEWEST:
                distortion = Distortion.of(shifts)
                self.tests[place] = distortion, distortion.just_detectable(z[without], shifts, rng)

    def __call__(self, x: Array) -> Array:
        """[worlds, components] Whitened statistics."""
        return np.asarray((self.fill(x) - self.middle) @ self.whiten)

    def local(self, x: Array) -> Array:
        """[worlds, distortions] Test statistics at the just detectable amplitudes."""
        z = self(x)
        return np.stack([one.ratio(z, amplitude) for one, amplitude in self.tests.values()], axis=1)

    def best(self, x: Array) -> NDArray[np.int64]:
        """[worlds] Effect whose distortion fits best, at its best amplitude."""
        z = self(x)
        fits = [np.max([one.ratio(z, a * k) for k in STRONGER], axis=0) for one, a in self.tests.values()]
        best: NDArray[np.int64] = np.array(list(self.tests))[np.argmax(fits, axis=0)]
        return best


class DistortionTests(Rival):
    """Likelihood ratio tests of just detectable distortions of the twin, one per effect.

    A gap is claimed when the largest of the test statistics, each relative to its spread without effects, exceeds that
    of 95 % of the training worlds without effects, which corrects for the number of tests. The effect whose distortion
    fits best is named: one at most, and never "outside the catalogue".
    """

    name = "distorted-simulator tests"

    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Estimate the distortions, and calibrate the tests on worlds without effects by cross-validation."""
        x, present = examples.x, examples.present
        without = rng.permutation(np.flatnonzero(~present.any(axis=1)))
        self.effects, self.fitted = examples.effects, _Fitted(x, present, rng)
        parts = []
        for fold in np.array_split(without, FOLDS):
            kept = np.setdiff1d(np.arange(len(x)), fold)
            parts.append(_Fitted(x[kept], present[kept], rng).local(x[fold]))
        null = np.concatenate(parts)
        self.middle, high = np.quantile(null, (0.5, 1 - LEVEL), axis=0)
        self.spread = np.maximum(high - self.middle, 1e-9)
        self.null = np.sort(self._largest(null))

    def _largest(self, local: Array) -> Array:
        return np.asarray(((local - self.middle) / self.spread).max(axis=1))

    def predict(self, x: Array) -> list[Found]:
        """The effect whose distortion fits best, for worlds with a significant one."""
        above = len(self.null) - np.searchsorted(self.null, self._largest(self.fitted.local(x)))
        p_values = (1 + above) / (1 + len(self.null))
        best = [(self.effects[place],) for place in self.fitted.best(x)]
        return [
            Found("explained", effects, p_value=p) if p <= LEVEL else Found("no_gap", p_value=p)
            for p, effects in zip(p_values.tolist(), best, strict=True)
        ]
