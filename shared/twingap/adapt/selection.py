"""Selection of a checkpoint without target labels.

Criteria depend on labelled source windows held out from training and on unlabelled target windows; higher is better.
`DEFAULT` is information maximisation, chosen without target accuracies. It is among the most reliable criteria for
adversarial methods in a large study (Musgrave et al. 2022, arXiv:2208.07360) and, unlike entropy, does not favour a
network that predicts a single class.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.training import Labels, Outputs

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """Input of a selection criterion: without target labels.

    Parameters
    ----------
    source : Outputs
        Outputs on source windows held out from training.
    source_labels : Labels
    target : Outputs
        Outputs on the unlabelled windows of the adaptation.
    """

    source: Outputs
    source_labels: Labels
    target: Outputs


def _entropy(p: Array) -> Array:
    """Shannon entropy along the last axis, in nats."""
    return np.asarray(-np.sum(p * np.log(np.maximum(p, 1e-12)), axis=-1))


def source_accuracy(evidence: Evidence) -> float:
    """Accuracy on held-out source windows, minus a small fraction of their loss to break ties."""
    hit = float(np.mean(evidence.source.predicted == evidence.source_labels))
    own = evidence.source.probabilities[np.arange(len(evidence.source_labels)), evidence.source_labels]
    return hit - 1e-3 * float(np.mean(-np.log(np.maximum(own, 1e-12))))


def target_entropy(evidence: Evidence) -> float:
    """Negative mean entropy of target predictions."""
    return -float(np.mean(_entropy(evidence.target.probabilities)))


def infomax(evidence: Evidence) -> float:
    """Entropy of the mean target prediction minus mean entropy: high for confident predictions of all classes."""
    p = evidence.target.probabilities
    return float(_entropy(p.mean(axis=0)) - np.mean(_entropy(p)))


def soft_neighbourhood_density(evidence: Evidence, temperature: float = 0.05) -> float:
    """Soft neighbourhood density of target windows in the space of predictions (Saito et al. 2021, arXiv:2108.10860).

    Mean entropy of each window's softmax similarity to all others.
    """
    p = evidence.target.probabilities
    unit = p / np.linalg.norm(p, axis=1, keepdims=True)
    similar = unit @ unit.T / temperature
    np.fill_diagonal(similar, -np.inf)
    similar = np.exp(similar - similar.max(axis=1, keepdims=True))
    return float(np.mean(_entropy(similar / similar.sum(axis=1, keepdims=True))))


CRITERIA: Final[dict[str, Callable[[Evidence], float]]] = {
    "infomax": infomax,
    "source_accuracy": source_accuracy,
    "target_entropy": target_entropy,
    "soft_neighbourhood_density": soft_neighbourhood_density,
}
"""Label-free criteria by name; higher is better."""

DEFAULT: Final = "infomax"


def select(evidence: Sequence[Evidence], criterion: str = DEFAULT) -> int:
    """Index of the checkpoint with the highest criterion; the latest among equals.

    Parameters
    ----------
    evidence : sequence of Evidence
        One per checkpoint, in order of training.
    criterion : str
        Key of `CRITERIA`.
    """
    scores = np.array([CRITERIA[criterion](e) for e in evidence])
    return int(len(scores) - 1 - np.argmax(scores[::-1]))
