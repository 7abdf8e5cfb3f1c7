"""Domain-adversarial training: gradient reversal, domain discriminator, schedule.

features --reversal(lambda)--> discriminator --> source or target   (features are trained to make this difficult)

Ganin et al. 2016, Domain-Adversarial Training of Neural Networks, JMLR 17(59), arXiv:1505.07818.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn

from twingap.adapt.nets import FEATURES


class _Reversal(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: float) -> Tensor:
        ctx.weight = weight
        return x.view_as(x)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        return -ctx.weight * gradients[0], None


def reverse_gradient(x: Tensor, weight: float) -> Tensor:
    """Identity whose gradient is multiplied by -`weight` (eq. 18 of Ganin et al.)."""
    reversed_: Tensor = _Reversal.apply(x, weight)  # type: ignore[no-untyped-call]
    return reversed_


class DomainDiscriminator(nn.Module):
    """Perceptron with two hidden layers of 64: features [batch, 100] -> logit of the target domain [batch]."""

    def __init__(self, features: int = FEATURES) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(features, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, 1)
        )  # fmt: skip

    def forward(self, features: Tensor) -> Tensor:
        """Logits [batch]."""
        logits: Tensor = self.layers(features).squeeze(1)
        return logits


def adversarial_schedule(progress: float, highest: float = 1.0, gamma: float = 10.0) -> float:
    """Weight of the reversed gradient at a fraction `progress` (0 to 1) of training: from 0 to `highest`.

    lambda_p = 2 / (1 + exp(-gamma p)) - 1, gamma = 10 (section 5.2.2 of Ganin et al.).
    """
    return highest * (2 / (1 + math.exp(-gamma * progress)) - 1)
