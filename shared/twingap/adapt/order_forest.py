"""Fault classes from fault orders and levels: trees that have only seen simulated fleets.

simulated fleets --windows--> order_features | levels_above_the_quietest --> extra-trees
real windows -------------------------------------------------------------------> probabilities

Extra-trees (Geurts et al. 2006, DOI 10.1007/s10994-006-6226-1) need no scaling, ignore numbers that say nothing, and
answer "as often so as so" where a fault leaves no line.
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
SHARE: Final = 0.4
"""Of the numbers tried at each split: most say nothing of any one machine."""
SMALLEST_LEAF: Final = 2
MOST_MEMBERS: Final = 8
"""Of a simulated fleet; the least of more recordings is lower by little."""


@dataclass(frozen=True)
class Examples:
    """Labelled windows of simulated fleets, as numbers.

    Parameters
    ----------
    features : Array [windows, features]
    labels : NDArray[int64] [windows]
    windows : int
        Of each record; those of a record follow each other.
    """

    features: Array
    labels: NDArray[np.int64]
    windows: int

    def __len__(self) -> int:
        return len(self.labels)


@dataclass(frozen=True)
class OrderForest:
    """A trained forest.

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
        """Probabilities [windows, classes] for windows of one fleet. Labels are not read."""
        return self.of_features(features(windows, self.bearing))

    def of_features(self, numbers: Array) -> Array:
        """The same from `features`."""
        out = np.zeros((len(numbers), self.n_classes))
        out[:, self.forest.classes_] = self.forest.predict_proba(numbers)
        return out


def features(windows: Windows, bearing: Bearing) -> Array:
    """What the trees see of the windows of one fleet [windows, features]."""
    return np.hstack([order_features(windows, bearing), levels_above_the_quietest(windows)])


def examples(
    fleets: Fleets,
    count: int,
    length: int,
    windows: int,
    rng: np.random.Generator,
    report: Callable[[float], None] = lambda done: None,
) -> Examples:
    """Simulate fleets and read them.

    Parameters
    ----------
    fleets : Fleets
    count : int
        Of fleets.
    length : int
        Samples of a window.
    windows : int
        Per record.
    rng : numpy.random.Generator
    report : callable
        Told the share that is done.
    """
    read, labels = [], []
    for number in range(count):
        made = cut(fleets.fleet(number, rng), length, windows, tuple(fleets.classes))
        assert made.labels is not None
        read.append((made, levels_above_the_quietest(made)))
        labels.append(made.labels)
        report((number + 1) / count)
    orders = order_features(joined([made for made, _ in read]), fleets.population.bearing)
    return Examples(
        np.hstack([orders, np.concatenate([levels for _, levels in read])]), np.concatenate(labels), windows
    )


def train_forest(shown: Examples, bearing: Bearing, n_classes: int, seed: int) -> OrderForest:
    """Train.

    Parameters
    ----------
    shown : Examples
    bearing : Bearing
    n_classes : int
    seed : int
        Same seed, same bytes.
    """
    from sklearn.ensemble import ExtraTreesClassifier

    forest = ExtraTreesClassifier(
        TREES, max_features=SHARE, min_samples_leaf=SMALLEST_LEAF, class_weight="balanced", random_state=seed, n_jobs=1
    )
    return OrderForest(forest.fit(shown.features, shown.labels), bearing, n_classes)
