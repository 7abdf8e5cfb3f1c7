"""Self-organising maps: severity without a fault label, and the class of the nearest map.

The map (Kohonen 1990, DOI 10.1109/5.58325) is a grid of units spread over the features; MQE(x), the minimum
quantisation error, is the distance from x to its best matching unit (Qiu, Lee, Lin and Yu 2003, DOI
10.1016/j.aei.2004.08.001), as in paper 2. The paper gives no threshold. Here it is a conformal one (Vovk, Gammerman and
Shafer 2005): for a window exchangeable with the healthy windows held out, P(alarm) <= false_alarm, whatever the
distribution of the features. Paper 2 uses SOM-MQE where fault data are plenty, to "identify the running state" (section
3.2.4), and says of severity alone how. A map a class is the reading taken for identification; of one record a class it
is the nearest neighbour.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from twingap import TwingapError


@dataclass(frozen=True)
class MapOptions:
    side: int = 6  # units along each side of the square grid, at least 2
    epochs: int = 20  # passes over the windows
    learning_rate: float = 0.5  # at the start; it decays with the passes
    # Added in quadrature to the spread of each feature, in the features' own unit: what one recording holds still need
    # not be still in the next. 0.115 nepers, 1 dB, suits logarithms of levels.
    least_spread: float = 0.0

    def __post_init__(self) -> None:
        if self.side < 2 or self.epochs < 1 or not 0 < self.learning_rate <= 1 or self.least_spread < 0:
            raise TwingapError(
                f"{self}", where="map options", mend="use a side of 2 or more, an epoch or more, a rate between 0 and 1"
            )


@dataclass(frozen=True)
class FeatureMap:
    """A trained map, with the scaling in front of it."""

    weights: Array  # [units, features] in scaled features
    centre: Array  # centre, spread: [features] mean and standard deviation of the features it was trained on
    spread: Array

    def mqe(self, features: Array) -> Array:
        """Distance of each window [windows, features] from its best matching unit [windows], in standard deviations of
        the training features; 0 on a unit."""
        x = (np.atleast_2d(features) - self.centre) / self.spread
        square = (x**2).sum(axis=1)[:, None] - 2 * x @ self.weights.T + (self.weights**2).sum(axis=1)
        # The expanded square loses digits close to a unit: the distance itself is taken from the unit that it names.
        best = self.weights[square.argmin(axis=1)]
        return np.asarray(np.sqrt(((x - best) ** 2).sum(axis=1)))


def fit_map(
    features: Array, options: MapOptions, rng: np.random.Generator, scaling: tuple[Array, Array] | None = None
) -> FeatureMap:
    """Train a map on windows [windows, features] of one state; a smaller grid where it would have more units than
    windows. `scaling` is centre and spread [features], in common for maps that are compared. Raises `TwingapError` for
    features that are not finite."""
    x = np.atleast_2d(np.asarray(features, dtype=np.float64))
    if x.size == 0 or not np.isfinite(x).all():
        raise TwingapError("features are missing or not finite", where="self-organising map")
    centre, spread = scaling_of(x, options.least_spread) if scaling is None else scaling
    scaled = (x - centre) / spread
    seed = int(rng.integers(2**31))
    side = min(options.side, math.isqrt(len(x)))
    if side < 2:  # a grid of one unit is the mean
        return FeatureMap(scaled.mean(axis=0, keepdims=True), centre, spread)
    from minisom import MiniSom

    net = MiniSom(side, side, scaled.shape[1], sigma=side / 3, learning_rate=options.learning_rate, random_seed=seed)
    net.pca_weights_init(scaled)
    net.train(scaled, options.epochs * len(scaled), random_order=True)
    return FeatureMap(np.asarray(net.get_weights(), dtype=np.float64).reshape(side**2, -1), centre, spread)


def scaling_of(features: Array, least_spread: float = 0.0) -> tuple[Array, Array]:
    """Mean and standard deviation of each feature; 1 where a feature does not vary and `least_spread` is 0."""
    spread = np.hypot(features.std(axis=0), least_spread)
    return features.mean(axis=0), np.where(spread > 1e-12 * (1 + np.abs(features).max(axis=0)), spread, 1.0)


def conformal_threshold(scores: Array, false_alarm: float) -> float:
    """The k-th smallest of n scores of healthy windows that the map did not see, k = ceil((n + 1) (1 - false_alarm)):
    one more exceeds it with a probability of at most `false_alarm`. Raises `TwingapError` for fewer scores than that
    needs."""
    if not 0 < false_alarm < 1:
        raise TwingapError(f"false_alarm = {false_alarm!r}, a fraction between 0 and 1 expected", where="threshold")
    n = int(np.size(scores))
    k = math.ceil((n + 1) * (1 - false_alarm) - 1e-9)
    if k > n:
        needed = math.ceil(1 / false_alarm - 1e-9) - 1
        raise TwingapError(
            f"{n} healthy windows held out, a false-alarm rate of {false_alarm:g} needs {needed}",
            where="threshold", mend="cut more or shorter windows, or allow more false alarms",
        )  # fmt: skip
    return float(np.sort(np.asarray(scores, dtype=np.float64))[k - 1])


@dataclass(frozen=True)
class HealthyMap:
    map: FeatureMap  # of all healthy windows
    threshold: float  # MQE above which a window alarms
    # [windows] MQE of each healthy window against a map that saw nothing of its group: what the threshold was read off
    held_out: Array

    def mqe(self, features: Array) -> Array:
        return self.map.mqe(features)


def healthy_map(
    features: Array, groups: NDArray[np.str_], false_alarm: float, rng: np.random.Generator,
    options: MapOptions | None = None, blocks: int = 5,
) -> HealthyMap:  # fmt: skip
    """Train on healthy windows [windows, features] and calibrate the alarm (rate for a window) on recordings (`groups`
    [windows]) held out in turn; a single one is cut into `blocks` stretches, and the rate holds for it alone. Raises
    `TwingapError` for fewer windows than the rate needs."""
    own = options or MapOptions()
    parts: NDArray[np.str_] | NDArray[np.int64] = groups
    if np.unique(groups).size < 2:
        parts = np.arange(len(groups)) * blocks // len(groups)
    held_out = np.empty(len(features))
    for part in np.unique(parts):
        out = parts == part
        held_out[out] = fit_map(features[~out], own, rng).mqe(features[out])
    threshold = conformal_threshold(held_out, false_alarm)
    return HealthyMap(fit_map(features, own, rng), threshold, held_out)


@dataclass(frozen=True)
class ClassMaps:
    """One map for each class, in a common scaling."""

    maps: tuple[FeatureMap | None, ...]  # by class; None for a class without a record, which is never answered

    def mqe(self, features: Array) -> Array:
        """Distance to each class's map [records, classes]; infinite where there is none."""
        return np.stack([np.full(len(features), np.inf) if m is None else m.mqe(features) for m in self.maps], axis=-1)

    def probabilities(self, features: Array) -> Array:
        """Soft votes [records, classes]: softmax of minus the distances over the least of them."""
        distance = self.mqe(features)
        least = np.maximum(distance.min(axis=1, keepdims=True), 1e-12)
        weight = np.exp(1 - distance / least)
        return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def fit_class_maps(
    features: Array, labels: NDArray[np.int64], n_classes: int, options: MapOptions, rng: np.random.Generator
) -> ClassMaps:
    """Train a map on the records [records, features] of each class."""
    scaling = scaling_of(features, options.least_spread)
    own = (features[labels == c] for c in range(n_classes))
    return ClassMaps(tuple(fit_map(x, options, rng, scaling) if len(x) else None for x in own))
