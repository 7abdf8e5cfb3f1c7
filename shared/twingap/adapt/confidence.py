"""Calibration of confidence by one temperature, fitted on labelled records that were not used for training.

mean probabilities of a record's windows --^ (1 / T), normalised--> --bounded by the number of records--> confidence

Source: Guo et al. 2017, "On Calibration of Modern Neural Networks" (arXiv:1706.04599); the bound is Laplace's rule of
succession: after n records without an error, the next is wrong with probability 1 / (n + 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from twingap.errors import TwingapError

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

HOTTEST: Final = 20.0
COLDEST: Final = 0.1
"""Bounds of the temperature; wider allow more extreme corrections."""
FOLDS: Final = 5
"""Folds of the cross-validation of the temperature."""


@dataclass(frozen=True)
class Calibration:
    """Fitted temperature.

    Parameters
    ----------
    temperature : float
        Above 1 for an overconfident classifier.
    records : int
        Number of records that it was fitted on.
    """

    temperature: float
    records: int

    def __call__(self, probabilities: Array) -> Array:
        """Calibrated probabilities [records, classes], in the same order."""
        return _tempered(probabilities, self.temperature, self.records)


@dataclass(frozen=True)
class Reliability:
    """Accuracy and confidence on records that a calibration was not fitted on.

    Parameters
    ----------
    accuracy : float
        Fraction of records classified correctly.
    confidence : float
        Mean confidence; equal to the accuracy if calibrated.
    error : float
        Expected calibration error: mean distance of the two over bins with equal numbers of records. It is above 0 even
        if calibrated, since bins are small.
    records : int
    """

    accuracy: float
    confidence: float
    error: float
    records: int


def calibrate_temperature(probabilities: Array, labels: Labels) -> Calibration:
    """Temperature that minimises the negative log-likelihood.

    Parameters
    ----------
    probabilities : Array [records, classes]
        Probabilities of records that were used neither for training nor for selection.
    labels : Labels [records]

    Raises
    ------
    TwingapError
        Without records.
    """
    n = len(labels)
    if n == 0:
        raise TwingapError("no records to calibrate on", where="calibrate_temperature", mend="hold some out")

    def loss(log_temperature: float) -> float:
        p = _tempered(probabilities, float(np.exp(log_temperature)), n)
        return -float(np.mean(np.log(p[np.arange(n), labels])))

    found = minimize_scalar(loss, bounds=(np.log(COLDEST), np.log(HOTTEST)), method="bounded", options={"xatol": 1e-4})
    return Calibration(float(np.exp(found.x)), n)


def cross_checked(probabilities: Array, labels: Labels) -> Reliability:
    """Cross-validated reliability: the temperature of each record is fitted on the other folds."""
    n = len(labels)
    fold = np.arange(n) // max(1, probabilities.shape[1]) % FOLDS  # classes alternate from record to record
    out = np.empty_like(probabilities)
    for one in np.unique(fold):
        left = fold == one
        kept = ~left if (~left).any() else left
        out[left] = calibrate_temperature(probabilities[kept], labels[kept])(probabilities[left])
    return reliability(out, labels)


def reliability(probabilities: Array, labels: Labels, bins: int = 5) -> Reliability:
    """Accuracy and confidence, and their distance.

    Parameters
    ----------
    probabilities : Array [records, classes]
    labels : Labels [records]
    bins : int
        Number of bins by confidence, with equal numbers of records.
    """
    confidence, right = probabilities.max(axis=1), probabilities.argmax(axis=1) == labels
    parts = np.array_split(np.argsort(confidence, kind="stable"), min(bins, len(labels)))
    error = sum(len(p) * abs(float(confidence[p].mean()) - float(right[p].mean())) for p in parts) / len(labels)
    return Reliability(float(right.mean()), float(confidence.mean()), float(error), len(labels))


def _tempered(probabilities: Array, temperature: float, records: int) -> Array:
    logits = np.log(np.maximum(probabilities, 1e-12)) / temperature
    raised = np.exp(logits - logits.max(axis=1, keepdims=True))
    p = raised / raised.sum(axis=1, keepdims=True)
    k = p.shape[1]
    # A uniform share limits the confidence to 1 - 1 / (records + 2).
    share = min(1.0, k / (k - 1) / (records + 2))
    return np.asarray((1 - share) * p + share / k)
