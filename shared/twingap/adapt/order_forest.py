"""Extra-trees on fault orders and levels, trained on simulated fleets of one bearing (paper 3's "Orders (ours)").

simulated fleets --windows--> order_features | levels_above_the_quietest --> extra-trees
real windows -------------------------------------------------------------------> probabilities

Extra-trees (Geurts et al. 2006, DOI 10.1007/s10994-006-6226-1) need no scaling and tolerate uninformative features.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.fleets import Fleets
from twingap.adapt.levels import levels_above_the_quietest
from twingap.adapt.order_features import order_features
from twingap.adapt.windows import Windows, cut, joined
from twingap.bearing import Bearing

if TYPE_CHECKING:
    from sklearn.ensemble import ExtraTreesClassifier

Array = NDArray[np.float64]

TREES: Final = 300
"""Number of trees; more make probabilities less noisy and are slower."""
SHARE: Final = 0.4
"""Fraction of the features tried at each split; more give more similar trees."""
SMALLEST_LEAF: Final = 2
"""Fewest examples in a leaf; more give smoother probabilities."""
MOST_MEMBERS: Final = 8
"""Most members of a simulated fleet; the minimum over more recordings is hardly lower."""


@dataclass(frozen=True)
class Examples:
    """Features and labels of windows of simulated fleets.

    Parameters
    ----------
    features : Array [windows, features]
    labels : NDArray[int64] [windows]
    windows : int
        Windows per record, consecutive in the arrays.
    """

    features: Array
    labels: NDArray[np.int64]
    windows: int

    def __len__(self) -> int:
        return len(self.labels)


@dataclass(frozen=True)
class OrderForest:
    """Trained forest for one bearing.

    Parameters
    ----------
    forest : ExtraTreesClassifier
    bearing : Bearing
    n_classes : int
    """

    forest: ExtraTreesClassifier
    bearing: Bearing
    n_classes: int

    def probabilities(self, windows: Windows) -> Array:
        """Probabilities [windows, classes] for windows of one fleet. Labels are not used."""
        return self.of_features(features(windows, self.bearing))

    def of_features(self, rows: Array) -> Array:
        """Probabilities [windows, classes] from `features`."""
        out = np.zeros((len(rows), self.n_classes))
        out[:, self.forest.classes_] = self.forest.predict_proba(rows)
        return out


def features(windows: Windows, bearing: Bearing) -> Array:
    """Features of the windows of one fleet [windows, features]."""
    return np.hstack([order_features(windows, bearing), levels_above_the_quietest(windows)])


def examples(
    fleets: Fleets,
    count: int,
    length: int,
    windows: int,
    rng: np.random.Generator,
    progress: Callable[[float], None] = lambda done: None,
) -> Examples:
    """Features and labels of simulated fleets.

    Parameters
    ----------
    fleets : Fleets
    count : int
        Number of fleets.
    length : int
        Samples of a window.
    windows : int
        Windows per record.
    rng : numpy.random.Generator
    progress : callable
        Called with the fraction done.
    """
    read, labels = [], []
    for number in range(count):
        made = cut(fleets.fleet(number, rng), length, windows, tuple(fleets.classes))
        assert made.labels is not None
        read.append((made, levels_above_the_quietest(made)))
        labels.append(made.labels)
        progress((number + 1) / count)
    orders = order_features(joined([made for made, _ in read]), fleets.population.bearing)
    return Examples(
        np.hstack([orders, np.concatenate([levels for _, levels in read])]), np.concatenate(labels), windows
    )


def train_forest(shown: Examples, bearing: Bearing, n_classes: int, seed: int) -> OrderForest:
    """Train a forest on examples.

    Parameters
    ----------
    shown : Examples
    bearing : Bearing
    n_classes : int
    seed : int
        Seed; the same seed gives the same bytes.
    """
    from sklearn.ensemble import ExtraTreesClassifier

    forest = ExtraTreesClassifier(
        TREES, max_features=SHARE, min_samples_leaf=SMALLEST_LEAF, class_weight="balanced", random_state=seed, n_jobs=1
    )
    return OrderForest(forest.fit(shown.features, shown.labels), bearing, n_classes)
