"""Scores of predictions on labelled windows, with intervals over seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from twingap.adapt.training import Labels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scores:
    """Scores of predictions.

    Parameters
    ----------
    accuracy : float
        Fraction of windows classified correctly.
    balanced_accuracy : float
        Mean over classes of the fraction classified correctly.
    confusion : NDArray[int64] [true, predicted]
        Numbers of windows.
    recordings_right, recordings : int
        Recordings whose mean probability is highest for the true class, and number of recordings.
    """

    accuracy: float
    balanced_accuracy: float
    confusion: NDArray[np.int64]
    recordings_right: int
    recordings: int


def score(probabilities: Array, labels: Labels, group: NDArray[np.str_]) -> Scores:
    """Scores of predictions on labelled windows.

    Parameters
    ----------
    probabilities : Array [windows, classes]
        One-hot rows where a method gives no probabilities.
    labels : Labels [windows]
    group : NDArray[str] [windows]
        Recording of each window.
    """
    predicted, n_classes = probabilities.argmax(axis=1), probabilities.shape[1]
    confusion = np.zeros((n_classes, n_classes), dtype=np.int64)
    np.add.at(confusion, (labels, predicted), 1)
    present = confusion.sum(axis=1) > 0
    recall = np.diag(confusion)[present] / confusion.sum(axis=1)[present]
    recordings = np.unique(group)
    right = sum(
        int(probabilities[group == g].mean(axis=0).argmax() == labels[group == g][0]) for g in recordings
    )  # fmt: skip
    return Scores(
        accuracy=float(np.mean(predicted == labels)),
        balanced_accuracy=float(recall.mean()),
        confusion=confusion,
        recordings_right=right,
        recordings=int(recordings.size),
    )


def t_interval(values: Sequence[float], level: float) -> tuple[float, float]:
    """Student's interval for the mean of independent, roughly normal values, such as accuracies over seeds.

    It covers the randomness of training only, since more seeds are no more bearings.

    Parameters
    ----------
    values : sequence of float
    level : float
        Confidence level, for instance 0.95.

    Returns
    -------
    (float, float)
        NaN with fewer than two values.
    """
    x = np.asarray(values, dtype=np.float64)
    if x.size < 2:
        return float("nan"), float("nan")
    half = float(stats.t.ppf(0.5 + level / 2, x.size - 1)) * float(x.std(ddof=1)) / np.sqrt(x.size)
    return float(x.mean() - half), float(x.mean() + half)


def bootstrap_interval(
    values: Sequence[float], level: float, rng: np.random.Generator, draws: int = 4000
) -> tuple[float, float]:
    """Percentile bootstrap interval for the mean; too narrow for few values, for which see `t_interval`."""
    x = np.asarray(values, dtype=np.float64)
    if x.size < 2:
        return float("nan"), float("nan")
    means = rng.choice(x, (draws, x.size)).mean(axis=1)
    low, high = np.quantile(means, [0.5 - level / 2, 0.5 + level / 2])
    return float(low), float(high)
