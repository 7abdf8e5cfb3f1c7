"""Training losses of the network for remaining life (eqs. 6, 7, 15).

life, label --eq. 7--> regression loss ------------------+--> `descended`: what gradient descent lowers
domain logits, domain --eqs. 7, 15--> domain loss -------+--> `objective`: eq. 6, of which training seeks the saddle

Source: sections 2.2 and 3.7 of paper 1, after Ganin et al. 2016, arXiv:1505.07818.
"""

from __future__ import annotations

from torch import Tensor
from torch.nn import functional

SIMULATED, REAL = 0.0, 1.0
"""Domain labels y of eq. 15."""


def regression_loss(life: Tensor, label: Tensor) -> Tensor:
    """L_r of eq. 7, averaged: the mean squared error of remaining life [batch] of simulated records."""
    return functional.mse_loss(life, label)


def domain_loss(logits: Tensor, domain: float) -> Tensor:
    """L_d of eqs. 7 and 15, averaged: -y log p - (1 - y) log(1 - p) with p = sigmoid(logit).

    Parameters
    ----------
    logits : Tensor [batch]
        From `LifeNetwork.domain`, all of one domain.
    domain : float
        y: SIMULATED or REAL.

    Returns
    -------
    Tensor []
        Finite for any logit: taken from the logit, not from p.
    """
    return functional.binary_cross_entropy_with_logits(logits, logits.new_full(logits.shape, domain))


def objective(regression: Tensor, simulated: Tensor, real: Tensor, weight: float = 0.1) -> Tensor:
    """L = L_r - lambda (L_d of simulated records + L_d of real ones), eq. 6.

    Extractor and regressor lower it, the discriminator raises it: for reports, and for what `descended` must amount to.

    Parameters
    ----------
    regression, simulated, real : Tensor []
        Averages over their own records, each domain by itself.
    weight : float
        lambda.
    """
    return regression - weight * (simulated + real)


def descended(regression: Tensor, simulated: Tensor, real: Tensor) -> Tensor:
    """What plain gradient descent lowers when the domain logits come from behind the reversal.

    Extractor and regressor then get the gradient of eq. 6, lambda included, and the discriminator that of L_d itself:
    by eq. 6 it would be lambda times as much, which only changes its step.
    """
    return regression + simulated + real
