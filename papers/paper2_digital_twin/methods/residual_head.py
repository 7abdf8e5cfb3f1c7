"""Correction of a trained network near labelled records, by a Gaussian process.

A network from a twin is wrong about one machine in ways that its own weights cannot unlearn: a ball that shows the
inner race's line is, as an image, an inner race. The process works on features that the network does not see. Near
labelled records it follows them; far from all of them its mean, the network, is what is left. Rasmussen and Williams,
Gaussian Processes for Machine Learning (MIT Press 2006), sections 2.7 (mean functions) and 3.5 (softmax, maximum of the
posterior).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

from papers.arrays import Array

JITTER: Final = 1e-6  # of the variance, added to the covariance's diagonal
STEPS: Final = 500  # of the search for the maximum, at most; the problem is convex


@dataclass(frozen=True)
class HeadOptions:
    # distance at which two records are no longer correlated, in standard deviations of a feature, root mean square over
    # features
    length: float = 0.5
    variance: float = 10.0  # of the corrections, logits squared
    # By what the network's log probabilities are multiplied: one trained on simulations alone is too sure of itself. 0:
    # the head without the network.
    trust: float = 0.5


@dataclass(frozen=True)
class ResidualHead:
    options: HeadOptions
    mean: Array  # mean, scale: [features] taken from the features and divided by
    scale: Array
    at: Array  # [labelled, features] scaled features of the labelled records
    weights: Array  # [labelled, classes] of their kernels

    def probabilities(self, logits: Array, features: Array) -> Array:
        """Of each class [records, classes], from the network's logits [records, classes] and features."""
        here = (features - self.mean) / self.scale
        correction = self.options.variance * _kernel(here, self.at, self.options.length) @ self.weights
        return np.asarray(softmax(self.options.trust * log_softmax(logits, axis=1) + correction, axis=1))


def fit_residual_head(
    logits: Array, features: Array, labels: NDArray[np.int64], reference: Array, options: HeadOptions | None = None
) -> ResidualHead:
    """Fit to labelled records: the network's logits [labelled, classes], which must not have learnt from them, features
    [labelled, features] and labels, each class of the same weight; `reference` [records, features] sets the scale."""
    own = options or HeadOptions()
    mean, scale = reference.mean(axis=0), reference.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    at = (features - mean) / scale
    offset = own.trust * log_softmax(logits, axis=1)
    number = np.bincount(labels)
    weight = (np.median(number[number > 0]) / np.maximum(number, 1))[labels]
    wanted = np.eye(logits.shape[1])[labels]
    covariance = own.variance * (_kernel(at, at, own.length) + JITTER * np.eye(len(at)))
    root = cholesky(covariance, lower=True)

    def lost(v: Array) -> tuple[float, Array]:
        """Negative log posterior and its gradient by the whitened process: corrections are root @ v."""
        white = v.reshape(wanted.shape)
        logs = log_softmax(offset + root @ white, axis=1)
        value = -float(weight @ logs[np.arange(len(labels)), labels]) + 0.5 * float(v @ v)
        slope = root.T @ (weight[:, None] * (np.exp(logs) - wanted)) + white
        return value, slope.ravel()

    found = minimize(lost, np.zeros(wanted.size), jac=True, method="L-BFGS-B", options={"maxiter": STEPS})
    weights = solve_triangular(root, found.x.reshape(wanted.shape), lower=True, trans="T")
    return ResidualHead(own, mean, scale, at, np.asarray(weights))


def _kernel(a: Array, b: Array, length: float) -> Array:
    """Squared exponential of the root-mean-square distance [a, b]."""
    apart = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    return np.asarray(np.exp(-np.maximum(apart, 0.0) / (2 * length**2 * a.shape[1])))
