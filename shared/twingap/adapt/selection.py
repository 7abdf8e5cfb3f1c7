"""Selection of a checkpoint without target labels.

Every criterion looks at labelled source windows held out from training and at unlabelled target windows; higher is
better. `DEFAULT` was chosen before any target accuracy was looked at: information maximisation, because in the largest
study of such criteria (Musgrave et al. 2022, arXiv:2208.07360) it is among the most dependable for adversarial
methods, and because, unlike plain entropy, it does not reward a network that calls everything one class.
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
        On source windows held out from training.
    source_labels : Labels
    target : Outputs
        On the unlabelled windows of adaptation.
    """

    source: Outputs
    source_labels: Labels
    target: Outputs


def _entropy(p: Array) -> Array:
    """Shannon entropy along the last axis, in nats."""
    return np.asarray(-np.sum(p * np.log(np.maximum(p, 1e-12)), axis=-1))


def source_accuracy(evidence: Evidence) -> float:
    """Accuracy on held-out source windows, less a sliver of their loss so that ties are broken."""
    hit = float(np.mean(evidence.source.predicted == evidence.source_labels))
    own = evidence.source.probabilities[np.arange(len(evidence.source_labels)), evidence.source_labels]
    return hit - 1e-3 * float(np.mean(-np.log(np.maximum(own, 1e-12))))


def target_entropy(evidence: Evidence) -> float:
    """Minus the mean entropy of target predictions: how sure the network is."""
    return -float(np.mean(_entropy(evidence.target.probabilities)))


def infomax(evidence: Evidence) -> float:
    """Entropy of the mean target prediction minus mean entropy: sure of each window, and using every class."""
    p = evidence.target.probabilities
    return float(_entropy(p.mean(axis=0)) - np.mean(_entropy(p)))


def soft_neighbourhood_density(evidence: Evidence, temperature: float = 0.05) -> float:
    """How many soft neighbours target windows have in the space of predictions (Saito et al. 2021, arXiv:2108.10860).

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
    """Place of the checkpoint that the criterion prefers; the latest of equals.

    Parameters
    ----------
    evidence : sequence of Evidence
        One per checkpoint, in order of training.
    criterion : str
        Key of `CRITERIA`.
    """
    scores = np.array([CRITERIA[criterion](e) for e in evidence])
    return int(len(scores) - 1 - np.argmax(scores[::-1]))
