"""Losses of domain adaptation: discriminators with reversed gradients, and kernel discrepancies.

features, logits of source and target --+--> reversal --> discriminators --> mean domain loss
                                        +--> kernel discrepancy (of all, or class by class) x weight

Sources: Ganin et al. 2016, arXiv:1505.07818 (reversal); Long et al. 2018, arXiv:1705.10667 (conditional discriminator);
Long et al. 2015, arXiv:1502.02791 (several kernels); Zhu et al. 2021, DOI 10.1109/TNNLS.2020.2988928 (class by class).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import torch
from torch import Tensor, nn

from twingap.adapt.dann import DomainDiscriminator, reverse_gradient
from twingap.adapt.nets import FEATURES

Discriminated = Literal["features", "conditional"]
Discrepancy = Literal["none", "domain", "category"]

BANDWIDTHS: Final = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Bandwidths of the kernels, relative to the mean squared distance of the batch."""
CONFIDENT: Final = 0.9
"""Probability from which target windows count for a class. With lower values, an untrained network draws each source
class towards the mean of the target, so that the classes collapse."""


@dataclass(frozen=True)
class Alignment:
    """Alignment of source and target domains; none by default.

    Parameters
    ----------
    discriminators : tuple of {"features", "conditional"}
        Each separates domains by the features, or by the outer product of features and predicted classes.
    discrepancy : {"none", "domain", "category"}
        Kernel discrepancy between the domains, or the mean over classes of that within a class. Target windows belong
        to a class that is predicted with high probability.
    weight : float
        Factor on the weight of the training.
    """

    discriminators: tuple[Discriminated, ...] = ()
    discrepancy: Discrepancy = "none"
    weight: float = 1.0

    @property
    def active(self) -> bool:
        """Whether target windows are used."""
        return bool(self.discriminators) or self.discrepancy != "none"


class BatchOutputs(NamedTuple):
    """Features and logits of a batch.

    Parameters
    ----------
    features : Tensor [batch, 100]
    logits : Tensor [batch, classes]
    """

    features: Tensor
    logits: Tensor


class Aligner(nn.Module):
    """Loss of an alignment, with its discriminators.

    Parameters
    ----------
    alignment : Alignment
    n_classes : int
    """

    def __init__(self, alignment: Alignment, n_classes: int) -> None:
        super().__init__()
        self.alignment, self.n_classes = alignment, n_classes
        self.discriminators = nn.ModuleList(
            DomainDiscriminator(FEATURES if kind == "features" else FEATURES * n_classes)
            for kind in alignment.discriminators
        )
        self.domain_loss = nn.BCEWithLogitsLoss()

    def forward(
        self, source: BatchOutputs, labels: Tensor, target: BatchOutputs, weight: float
    ) -> tuple[Tensor, Tensor | None]:
        """Loss of the alignment, and the fraction of samples whose domain is classified correctly (or None).

        Parameters
        ----------
        source : BatchOutputs
        labels : Tensor [batch]
        target : BatchOutputs
        weight : float
            Weight of the reversed gradient and of the discrepancy; at 0 the network has the gradients of the source
            only.
        """
        weight = weight * self.alignment.weight
        losses: list[Tensor] = []
        correct: list[Tensor] = []
        if self.discriminators:
            both = torch.cat([source.features, target.features])
            domain = (torch.arange(len(both), device=both.device) >= len(source.features)).float()
            each = []
            for kind, discriminator in zip(self.alignment.discriminators, self.discriminators, strict=True):
                shown = both
                if kind == "conditional":
                    # Gradients act on features only and not on predictions, as in the authors' code.
                    confident = torch.cat([source.logits, target.logits]).softmax(dim=1).detach()
                    shown = (confident[:, :, None] * both[:, None, :]).flatten(1)
                guess = discriminator(reverse_gradient(shown, weight))
                each.append(self.domain_loss(guess, domain))
                correct.append(((guess.detach() > 0) == (domain > 0.5)).float().mean())
            losses.append(torch.stack(each).mean() if len(each) > 1 else each[0])
        if self.alignment.discrepancy == "domain":
            losses.append(weight * kernel_discrepancy(source.features, target.features))
        elif self.alignment.discrepancy == "category":
            own = nn.functional.one_hot(labels, self.n_classes).to(source.features.dtype)
            confident = target.logits.softmax(dim=1).detach()
            confident = confident * (confident >= CONFIDENT)
            losses.append(weight * kernel_discrepancy(source.features, target.features, own, confident))
        loss = sum(losses[1:], losses[0])
        return loss, (torch.stack(correct).mean() if correct else None)


def kernel_discrepancy(
    source: Tensor, target: Tensor, source_weights: Tensor | None = None, target_weights: Tensor | None = None
) -> Tensor:
    """Squared maximum mean discrepancy with a sum of Gaussian kernels, mean over weightings; the unbiased estimate.

    The biased estimate, which includes the kernel of each sample with itself, is more common in this field. Its bias
    grows with the scatter of a batch, so that minimising it collapses the features of both domains into a point.

    Parameters
    ----------
    source, target : Tensor [n, features], [m, features]
    source_weights, target_weights : Tensor [n, weightings], [m, weightings], optional
        Not negative; each column is scaled to sum 1. A column with fewer than two samples of either domain is ignored.
        Default: one column of equal weights.

    Returns
    -------
    Tensor
        Scalar; its mean is 0 for equal distributions, so it can be negative.
    """
    a = torch.ones_like(source[:, :1]) if source_weights is None else source_weights
    b = torch.ones_like(target[:, :1]) if target_weights is None else target_weights
    a = a / a.sum(dim=0).clamp_min(1e-6)
    b = b / b.sum(dim=0).clamp_min(1e-6)
    both = torch.cat([source, target])
    square = both.square().sum(dim=1)
    distance = (square[:, None] + square[None] - 2 * both @ both.T).clamp_min(0.0)
    scale = distance.detach().mean().clamp_min(1e-12)
    kernel = sum((torch.exp(-distance / (scale * width)) for width in BANDWIDTHS), torch.zeros_like(distance))
    n = len(source)
    # 1 minus the sum of squared weights: the fraction of pairs of different samples.
    pairs_a, pairs_b = 1 - a.square().sum(dim=0), 1 - b.square().sum(dim=0)
    usable = (a.sum(dim=0) > 0.5) & (b.sum(dim=0) > 0.5) & (pairs_a > 1e-3) & (pairs_b > 1e-3)
    each = _within(kernel[:n, :n], a, pairs_a) + _within(kernel[n:, n:], b, pairs_b)
    each = each - 2 * (a * (kernel[:n, n:] @ b)).sum(dim=0)
    return (each * usable).sum() / usable.sum().clamp_min(1)


def _within(kernel: Tensor, weights: Tensor, pairs: Tensor) -> Tensor:
    """Mean kernel between different samples of one domain, per weighting."""
    own = (weights.square() * kernel.diagonal()[:, None]).sum(dim=0)
    return ((weights * (kernel @ weights)).sum(dim=0) - own) / pairs.clamp_min(1e-3)
