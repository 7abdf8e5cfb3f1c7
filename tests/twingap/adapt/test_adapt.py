"""Training with and without adaptation: gradients, determinism, what differs and what must not."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from twingap.adapt import (
    DomainDiscriminator,
    PlainCNN,
    Training,
    adversarial_schedule,
    outputs,
    reproducible,
    reverse_gradient,
    train,
)
from twingap.adapt.training import Trained

SMALL = Training(steps=30, batch=16, checkpoints=3)


def toy(n: int = 96, seed: int = 0, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Two classes told apart by the frequency of a sine; a shifted domain has another amplitude and offset."""
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % 2
    t = np.arange(256) / 256
    wave = np.sin(2 * np.pi * (np.where(labels, 40, 15)[:, None] * t + rng.random((n, 1))))
    x = (1 + shift) * wave + shift + 0.3 * rng.standard_normal((n, 256))
    return x[:, None, :].astype(np.float32), labels.astype(np.int64)


def fit(method: str, settings: Training = SMALL, seed: int = 0) -> Trained:
    x, y = toy()
    return train(x, y, toy(64, 1, 0.5)[0], method, settings, seed, 2, "cpu")  # type: ignore[arg-type]


def same(one: Trained, two: Trained) -> bool:
    pairs = zip(one.checkpoints, two.checkpoints, strict=True)
    return all(torch.equal(a.state[name], b.state[name]) for a, b in pairs for name in a.state)


def test_shapes_are_as_documented() -> None:
    net = PlainCNN(2048, 4)
    assert sum(p.numel() for p in net.parameters()) == 124_424
    assert net.extractor[0](torch.zeros(1, 1, 2048)).shape == (1, 16, 256)
    assert net.extractor(torch.zeros(3, 1, 2048)).shape == (3, 100)
    assert net(torch.zeros(3, 1, 2048)).shape == (3, 4)
    for length in (128, 512, 1000, 1024):
        assert PlainCNN(length, 3)(torch.zeros(2, 1, length)).shape == (2, 3)
    with pytest.raises(ValueError, match="at least 128"):
        PlainCNN(127, 4)


def test_reversal_keeps_values_and_turns_gradients() -> None:
    x = torch.tensor([1.0, -2.0, 3.0], requires_grad=True)
    y = reverse_gradient(x, 0.7)
    assert torch.equal(y, x)
    (y * torch.tensor([1.0, 10.0, 100.0])).sum().backward()
    assert x.grad is not None
    torch.testing.assert_close(x.grad, -0.7 * torch.tensor([1.0, 10.0, 100.0]))


def test_reversal_moves_features_against_the_discriminator() -> None:
    """A step along the reversed gradient raises the domain loss; a plain step lowers it."""
    torch.manual_seed(0)
    discriminator, domain = DomainDiscriminator(), torch.tensor([0.0, 1.0] * 8)
    features = torch.randn(16, 100)

    def loss_after(reverse: bool) -> float:
        x = features.clone().requires_grad_()
        seen = reverse_gradient(x, 1.0) if reverse else x
        torch.nn.functional.binary_cross_entropy_with_logits(discriminator(seen), domain).backward()
        assert x.grad is not None
        moved = discriminator(features - 0.5 * x.grad)
        return float(torch.nn.functional.binary_cross_entropy_with_logits(moved, domain).detach())

    before = float(torch.nn.functional.binary_cross_entropy_with_logits(discriminator(features), domain).detach())
    assert loss_after(reverse=True) > before > loss_after(reverse=False)


def test_schedule_is_that_of_ganin() -> None:
    assert adversarial_schedule(0.0) == 0.0
    assert adversarial_schedule(0.5) == pytest.approx(2 / (1 + np.exp(-5)) - 1)
    assert adversarial_schedule(1.0, highest=0.3) == pytest.approx(0.3, rel=1e-3)


@pytest.mark.parametrize("method", ["source_only", "dann"])
def test_same_seed_same_weights(method: str) -> None:
    torch.manual_seed(1)  # the caller's own state must not matter
    one = fit(method)
    torch.manual_seed(2)
    assert same(one, fit(method))
    assert not same(one, fit(method, seed=1))


def test_methods_differ_in_the_domain_loss_alone() -> None:
    plain = fit("source_only")
    assert same(plain, fit("dann", replace(SMALL, adversarial_weight=0.0)))
    assert not same(plain, fit("dann"))


def test_source_only_does_not_look_at_the_target() -> None:
    x, y = toy()
    one = train(x, y, toy(64, 1, 0.5)[0], "source_only", SMALL, 0, 2, "cpu")
    two = train(x, y, np.full((8, 1, 256), np.nan, np.float32), "source_only", SMALL, 0, 2, "cpu")
    assert same(one, two)


def test_threads_do_not_change_the_bytes() -> None:
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(2)
        two = fit("dann")
        torch.set_num_threads(1)
        assert same(fit("dann"), two)
    finally:
        torch.set_num_threads(before)


def test_nothing_global_is_left_changed() -> None:
    torch.manual_seed(5)
    expected, threads = torch.rand(3), torch.get_num_threads()
    torch.manual_seed(5)
    np.random.seed(3)  # noqa: NPY002 - to see that training does not draw from it
    state = np.random.get_state()[1].tolist()  # noqa: NPY002
    fit("dann")
    assert torch.equal(torch.rand(3), expected)
    assert torch.get_num_threads() == threads and not torch.are_deterministic_algorithms_enabled()
    assert np.random.get_state()[1].tolist() == state  # noqa: NPY002
    with pytest.raises(KeyError), reproducible(0):
        raise KeyError
    assert torch.get_num_threads() == threads


def test_it_learns_and_adaptation_hides_the_domain() -> None:
    x, y = toy(256)
    target, labels = toy(128, 2, 0.5)
    longer = Training(steps=150, batch=32, checkpoints=3)
    plain = train(x, y, target, "source_only", longer, 0, 2, "cpu")
    adapted = train(x, y, target, "dann", longer, 0, 2, "cpu")
    for trained in (plain, adapted):
        assert np.mean(outputs(trained.network(), target).predicted == labels) > 0.9
    assert adapted.checkpoints[-1].domain_accuracy < 0.95
    assert np.isnan(plain.checkpoints[-1].domain_accuracy)


def test_predictions_do_not_depend_on_the_batch() -> None:
    net, x = fit("source_only").network(), toy(70)[0]
    np.testing.assert_allclose(outputs(net, x, batch=7).logits, outputs(net, x).logits, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(outputs(net, x).probabilities.sum(axis=1), 1.0)
