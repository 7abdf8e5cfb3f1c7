"""Hierarchical prior of a fleet: the prevalence of an effect, and each machine's probability given all machines.

own probabilities [machines], prevalence in training --likelihood ratios--> posterior of the prevalence
                                                     --averaged over it--> probability with the fleet [machines]

A calibrated probability p of one machine holds for the prevalence q0 of the training. Its likelihood ratio is
r = p / (1 - p) / (q0 / (1 - q0)). For machines that are independent given the prevalence q of their fleet,

    P(all machines | q) = prod_i (q r_i + 1 - q),    P(machine i has it | q) = q r_i / (q r_i + 1 - q).

The maximum over q is that of the EM algorithm of Saerens, Latinne and Decaestecker 2002
(doi:10.1162/089976602753284446), which is too certain for few machines. Here q has a beta prior with the mean q0, and
both are averaged over its posterior, on a grid. The probability of a single machine remains as it is.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.effects import trainable
from twingap.effects.registry import own_effects
from twingap.gap.knowledge.simulated_gaps import HOW_MANY

Array = NDArray[np.float64]

STRENGTH: Final = 4.0
"""Number of machines that the prior of the prevalence counts as. A larger value moves probabilities less."""
LEVEL: Final = 0.9
"""Level of the interval of the prevalence."""
_LEAST_P: Final = 0.01
"""Probabilities are clipped this far from 0 and 1 where the prevalence is estimated: smaller ones are less certain than
they state, because effects that a machine's records cannot show were left out of their calibration. A smaller value
lets effects that were not found count for more against other machines."""
_BLOCK: Final = 256
"""Machines per step. A larger number takes more memory."""


class Prevalence(NamedTuple):
    """Prevalence of an effect in a fleet.

    Parameters
    ----------
    mean : float
        Posterior mean.
    ci : (float, float)
        90 % interval.
    probability : Array [machines]
        That each machine has the effect, given all machines.
    """

    mean: float
    ci: tuple[float, float]
    probability: Array


def training_prevalence() -> dict[str, float]:
    """Part of the simulated machines of the training that lack each effect; none for effects not trained on."""
    kinds = {name: kind for name, kind in trainable().items() if name not in own_effects()}
    mean = float(np.arange(len(HOW_MANY)) @ np.array(HOW_MANY))
    total = sum(kind.draw_weight for kind in kinds.values())
    return {name: mean * kind.draw_weight / total for name, kind in kinds.items()}


def prevalence(own: ArrayLike, trained: float, strength: float = STRENGTH) -> Prevalence:
    """Posterior of an effect's prevalence, and of each machine given all.

    Parameters
    ----------
    own : array-like [machines]
        Calibrated probability of each machine by itself.
    trained : float
        Prevalence in the training that these probabilities hold for.
    strength : float
        Number of machines that the prior counts as.
    """
    from scipy.special import expit
    from scipy.stats import beta

    ratio, clipped = (_ratios(own, trained, least) for least in (1e-9, _LEAST_P))
    edges = np.concatenate(([0.0], expit(np.linspace(-12, 12, 2001)), [1.0]))
    q = (edges[:-1] + edges[1:]) / 2
    prior = np.diff(beta.cdf(edges, strength * trained, strength * (1 - trained)))
    # Means of the prior within cells, not their middles: the outermost cells hold much of it.
    q = _means(edges, prior, q, strength, trained)
    with np.errstate(divide="ignore"):
        log = np.log(prior)
    for part in _blocks(clipped):
        log += np.log1p(np.multiply.outer(part - 1, q)).sum(axis=0)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    parts = [(np.multiply.outer(r, q) / (np.multiply.outer(r - 1, q) + 1)) @ weight for r in _blocks(ratio)]
    tail, total = (1 - LEVEL) / 2, np.cumsum(weight)
    low, high = np.interp([tail, 1 - tail], total, edges[1:])
    ends = (0.0 if total[0] >= tail else float(low), 1.0 if total[-2] <= 1 - tail else float(high))
    return Prevalence(float(q @ weight), ends, np.concatenate(parts))


def _ratios(own: ArrayLike, trained: float, least: float) -> Array:
    """Likelihood ratios of probabilities that hold for a prevalence."""
    p = np.clip(np.asarray(own, float), least, 1 - least)
    return np.asarray(p / (1 - p) / (trained / (1 - trained)))


def _means(edges: Array, prior: Array, middle: Array, strength: float, trained: float) -> Array:
    """Mean of the prior in each cell of the grid; the middle of cells without prior."""
    from scipy.stats import beta

    # q Beta(q; a, b) is the mean times Beta(q; a + 1, b).
    moment = trained * np.diff(beta.cdf(edges, strength * trained + 1, strength * (1 - trained)))
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.where(prior > 1e-200, moment / prior, middle)
    return np.asarray(np.clip(mean, edges[:-1], edges[1:]))


def _blocks(values: Array) -> list[Array]:
    return np.split(values, range(_BLOCK, values.size, _BLOCK)) if values.size else []
