"""The network of tables 1 and 2: sizes, who sees which input, and the gradients of eq. 6."""

import dataclasses
import math

import pytest
import torch
from torch import Tensor
from torch.nn.functional import mse_loss

from papers.paper1_rul_varying_speed.methods.architecture import MODELS, LifeArchitecture, architecture_of
from papers.paper1_rul_varying_speed.methods.network import LifeNetwork
from papers.paper1_rul_varying_speed.methods.training import REAL, SIMULATED, domain_loss
from twingap.errors import TwingapError

SHORT = 6000


def made(name: str, length: int = SHORT) -> LifeNetwork:
    torch.manual_seed(0)
    return LifeNetwork(dataclasses.replace(MODELS[name], length=length))


def drawn(batch: int, length: int = SHORT, seed: int = 0) -> tuple[Tensor, Tensor, Tensor]:
    rng = torch.Generator().manual_seed(seed)
    return tuple(torch.randn(batch, n, generator=rng) for n in (length, 24, 24))  # type: ignore[return-value]


def test_features_are_those_of_the_text_and_of_table_1() -> None:
    assert architecture_of("CNN").features == 112
    assert architecture_of("CNN", printed=True).features == 32
    assert LifeArchitecture(strides=(16, 6), pools=(8, 4)).features == 112
    for printed, features in ((False, 112), (True, 32)):
        net = LifeNetwork(architecture_of("Proposed model 3", printed=printed))
        x, sequence, speed = drawn(2, 25000)
        joined = net.join(x, sequence, speed)
        assert joined.shape == (2, features + 48)
        assert torch.equal(joined[:, features:], torch.cat((sequence, speed), dim=1))
        assert net.embed(joined).shape == (2, 32) and net(x, sequence, speed).shape == (2,)
        assert net.domain(joined).shape == (2,)


def test_the_five_models() -> None:
    table = {n: (a.sequence, a.speed, a.adversarial) for n, a in MODELS.items()}
    assert table == {
        "CNN": (False, False, False),
        "DANN": (False, False, True),
        "Proposed model 1": (False, True, False),
        "Proposed model 2": (True, False, False),
        "Proposed model 3": (True, True, True),
    }
    with pytest.raises(TwingapError, match="choose from CNN, DANN"):
        architecture_of("CNNN")


@pytest.mark.parametrize("name", list(MODELS))
def test_a_model_looks_at_its_own_inputs_only(name: str) -> None:
    net, own = made(name), MODELS[name]
    x, sequence, speed = drawn(8)
    out = net(x, sequence, speed)
    assert out.shape == (8,) and (out >= 0).all() and (out > 0).any()
    assert torch.equal(net(x, -sequence, speed), out) != own.sequence
    assert torch.equal(net(x, sequence, -speed), out) != own.speed
    # Records of a batch do not see one another.
    assert torch.allclose(net(x[:3], sequence[:3], speed[:3]), out[:3], atol=1e-6)
    if own.sequence:
        with pytest.raises(TwingapError, match="sequence encoding None"):
            net(x, None, speed)
    if not own.adversarial:
        with pytest.raises(TwingapError, match="no discriminator"):
            net.domain(net.join(x, sequence, speed))


def test_inputs_that_do_not_fit_are_refused() -> None:
    with pytest.raises(TwingapError, match=r"\[batch, 6000\]"):
        made("CNN")(torch.zeros(2, 5999))
    with pytest.raises(TwingapError, match="longer records"):
        LifeNetwork(LifeArchitecture(length=500))


def test_equation_15_is_the_cross_entropy_and_finite() -> None:
    logit = torch.tensor([0.3, -2.0])
    p = torch.sigmoid(logit)
    assert domain_loss(logit, REAL) == pytest.approx(float(-torch.log(p).mean()), rel=1e-5)
    assert domain_loss(logit, SIMULATED) == pytest.approx(float(-torch.log(1 - p).mean()), rel=1e-5)
    assert math.isfinite(float(domain_loss(torch.tensor([500.0]), SIMULATED)))


def test_descent_behind_the_reversal_is_the_saddle_of_equation_6() -> None:
    """Extractor and regressor get eq. 6's gradient, the discriminator its own loss's: -1/lambda of eq. 6's."""
    net = made("Proposed model 3").double()
    a, b = ([t.double() for t in drawn(6, seed=s)] for s in (1, 2))
    label = torch.linspace(0, 1, 6).double()

    def gradients(reverse: bool) -> dict[str, Tensor]:
        net.zero_grad()
        source, target = net.join(*a), net.join(*b)
        assert net.discriminator is not None
        logits = [net.domain(s) if reverse else net.discriminator(s).squeeze(1) for s in (source, target)]
        told_apart = domain_loss(logits[0], SIMULATED) + domain_loss(logits[1], REAL)
        total = mse_loss(net.life(source), label) + (1.0 if reverse else -0.1) * told_apart
        total.backward()  # type: ignore[no-untyped-call]
        return {name: p.grad.clone() for name, p in net.named_parameters() if p.grad is not None}

    with_reversal, plain = gradients(True), gradients(False)
    assert with_reversal.keys() == plain.keys() and any(float(g.abs().max()) > 0 for g in plain.values())
    for name, gradient in with_reversal.items():
        wanted = -10 * plain[name] if name.startswith("discriminator") else plain[name]
        assert torch.allclose(gradient, wanted, rtol=1e-9, atol=1e-14), name
