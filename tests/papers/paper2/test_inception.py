"""The Inception-style network: it learns, says what it says, same seed same bytes."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from papers.paper2_digital_twin.methods.inception import (
    InceptionBlock,
    InceptionNet,
    InceptionTraining,
    evidence,
    outputs,
    train_inception,
)
from twingap.adapt.selection import source_accuracy

SHAPE = (3, 8, 32)
QUICK = InceptionTraining(steps=60, batch=32, checkpoints=2, width=4)


def lines(n: int, rng: np.random.Generator, places: tuple[int, ...] = (6, 14, 22)) -> tuple[np.ndarray, np.ndarray]:
    """Images with a line at the order of their class, on carriers of their own."""
    labels = np.arange(n) % len(places)
    x = 0.3 * rng.standard_normal((n, *SHAPE))
    for i, label in enumerate(labels):
        x[i, :2, rng.integers(0, 8, 4), places[label]] += 2
    return x.astype(np.float32), labels.astype(np.int64)


@pytest.fixture(scope="module")
def learnt() -> tuple[np.ndarray, np.ndarray, list[dict[str, torch.Tensor]]]:
    x, y = lines(240, np.random.default_rng(0))
    return x, y, train_inception(x, y, 3, QUICK, seed=1)


def test_it_tells_lines_apart_on_carriers_it_never_saw_them_on(learnt) -> None:  # type: ignore[no-untyped-def]
    x, y = lines(90, np.random.default_rng(5))
    told = outputs(learnt[2][-1], x, 3, QUICK).probabilities
    assert told.shape == (90, 3)
    np.testing.assert_allclose(told.sum(axis=1), 1, atol=1e-6)
    assert (told.argmax(axis=1) == y).mean() > 0.9


def test_same_seed_same_bytes_and_another_differs(learnt) -> None:  # type: ignore[no-untyped-def]
    x, y, states = learnt
    short = InceptionTraining(steps=4, batch=8, checkpoints=2, width=4)
    a, b, c = (train_inception(x, y, 3, short, seed=s)[-1] for s in (3, 3, 4))
    assert all(torch.equal(a[name], b[name]) for name in a)
    assert not all(torch.equal(a[name], c[name]) for name in a)
    assert len(states) == QUICK.checkpoints


def test_evidence_is_the_networks_own_word(learnt) -> None:  # type: ignore[no-untyped-def]
    x, y, states = learnt
    (seen,) = evidence(states[-1:], x, y, x[:7], 3, QUICK)
    np.testing.assert_allclose(seen.target.probabilities, outputs(states[-1], x[:7], 3, QUICK).probabilities)
    assert source_accuracy(seen) > 0.9


def test_every_branch_and_bottleneck_takes_part() -> None:
    block = InceptionBlock(5, 4)
    out = block(torch.randn(2, 5, 6, 9))
    assert out.shape == (2, 16, 6, 9)
    net = InceptionNet(SHAPE, 4, width=4)
    net(torch.randn(4, *SHAPE)).square().sum().backward()
    assert all(p.grad is not None and float(p.grad.abs().sum()) > 0 for p in net.parameters())
    kernels = {tuple(m.kernel_size) for m in block.modules() if isinstance(m, torch.nn.Conv2d)}
    assert kernels == {(1, 1), (3, 3)}


def test_images_too_small_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 8 x 16"):
        InceptionNet((3, 4, 32), 4)
