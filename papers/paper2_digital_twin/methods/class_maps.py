"""Classifier by self-organising maps: one map for each state; the nearest map gives the class.

labelled features --of each class--> map --+
                                           +--> least MQE --> class
new features -----------------------------+

Paper 2 uses SOM-MQE where fault data are plenty, to "identify the running state" (section 3.2.4), and says of severity
alone how. This is the reading taken for identification. With one record a class it is the nearest neighbour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.paper2_digital_twin.methods.severity import FeatureMap, MapOptions, fit_map, scaling_of


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
