"""Blocks of paper 3's network: shapes, attention against plain loops, the gate's range, every variant's parts."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor, nn

from twingap.adapt import FEATURES, Alignment, Architecture, ModeNetwork, kernel_discrepancy, reproducible
from twingap.adapt.alignment import BANDWIDTHS, Aligner, BatchOutputs
from twingap.adapt.attention import MappingAttention, TimeAttention, cosine_scores, scaled_dot_scores
from twingap.adapt.denoising import CompactBranches, CrossBranchFusion, DenoisingGate, Lift, clipped
from twingap.adapt.mode_network import AttentionKind

ATTENTIONS: tuple[AttentionKind, ...] = ("none", "time", "mappings", "cosine")


def drawn(*shape: int, seed: int = 0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).standard_normal(shape).astype(np.float32))


# -- shapes -----------------------------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(
    modes=st.integers(1, 5),
    maps=st.integers(1, 3),
    batch=st.integers(1, 4),
    length=st.integers(8, 24).map(lambda n: 32 * n),
    denoising=st.booleans(),
    attention=st.sampled_from(ATTENTIONS),
    classes=st.integers(2, 5),
)
def test_shapes_of_every_variant(
    modes: int, maps: int, batch: int, length: int, denoising: bool, attention: AttentionKind, classes: int
) -> None:
    x = drawn(batch, modes, length)
    net = ModeNetwork(Architecture(denoising, attention, maps=maps, width=16), length, modes, classes)
    channels = 3 * modes * maps
    expected = {
        "denoising": (batch, channels, length // 8),
        "lift": (batch, channels, length // 8),
        "attention": (batch, channels, length // 8),
        "feed_forward": (batch, FEATURES),
    }
    names = [name for name, _ in net.extractor.named_children()]
    assert names == (
        ["denoising" if denoising else "lift"] + ["attention"] * (attention != "none") + ["feed_forward"]
    )  # fmt: skip
    for name, stage in net.extractor.named_children():
        x = stage(x)
        assert x.shape == expected[name], name
    assert net.classifier(x).shape == (batch, classes)


@pytest.mark.parametrize(("modes", "kernels", "maps"), [(4, (5, 7, 9), 2), (1, (5,), 1), (3, (5, 11), 3)])
def test_shapes_within_the_denoising_network(modes: int, kernels: tuple[int, ...], maps: int) -> None:
    channels = modes * maps * len(kernels)
    branched = CompactBranches(modes, kernels, maps)(drawn(2, modes, 256))
    assert branched.shape == (2, channels, 64)
    assert CrossBranchFusion(modes, channels)(branched).shape == (2, channels, 32)
    assert Lift(modes, channels)(drawn(2, modes, 256)).shape == (2, channels, 32)


def test_branches_are_convolutions_side_by_side() -> None:
    """Sorted by mode, then branch, whatever the lengths of their kernels."""
    branches, x = CompactBranches(3, (5, 9), 2), drawn(2, 3, 64)
    each = [branch(x) for branch in branches.branches]  # [2, 3 x 2, 16] each
    expected = torch.stack([e.unflatten(1, (3, 2)) for e in each], dim=2).flatten(1, 3)
    torch.testing.assert_close(branches(x), torch.relu(branches.norm(expected)))


def test_lengths_that_do_not_fit_are_refused() -> None:
    for length in (128, 1000):
        with pytest.raises(ValueError, match="multiple of 32"):
            ModeNetwork(Architecture(), length, 4, 4)
    with pytest.raises(ValueError, match="odd"):
        CompactBranches(4, (4,), 2)
    with pytest.raises(ValueError, match="multiple of 4"):
        TimeAttention(4, 30, 8)


def test_modes_meet_only_in_the_attention() -> None:
    """What enters by one mode leaves the denoising network by that mode's mappings alone."""
    net = ModeNetwork(Architecture(attention="none"), 512, 4, 4)
    before = net.extractor.get_submodule("denoising")
    gate = before.get_submodule("gate")
    x, y = drawn(1, 4, 512), drawn(1, 4, 512, seed=1)
    y[:, [0, 1, 3]] = x[:, [0, 1, 3]]
    changed = (before(x) - before(y)).abs().amax(dim=2)[0].unflatten(0, (4, -1)).amax(dim=1)
    assert isinstance(gate, DenoisingGate)
    assert (changed > 0).tolist() == [False, False, True, False]


@pytest.mark.parametrize("attention", ATTENTIONS)
@pytest.mark.parametrize("denoising", [True, False])
def test_every_parameter_learns(attention: AttentionKind, denoising: bool) -> None:
    with reproducible(0):
        net = ModeNetwork(Architecture(denoising, attention), 256, 2, 3)
        nn.functional.cross_entropy(net(drawn(6, 2, 256)), torch.arange(6) % 3).backward()
    still = [name for name, p in net.named_parameters() if p.grad is None or not p.grad.abs().any()]
    # A shift common to all scores of a row is nothing to a softmax: the key's offset has no gradient but rounding.
    assert [name for name in still if not name.endswith("key.bias")] == []


# -- gate -------------------------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(scale=st.floats(-1e3, 1e3), loud=st.floats(1e-3, 1e3), dynamic=st.booleans())
def test_the_gate_stays_in_its_range(scale: float, loud: float, dynamic: bool) -> None:
    gate, x = DenoisingGate(3, dynamic=dynamic), loud * drawn(5, 3, 16)
    with torch.no_grad():
        gate.scale.fill_(scale)
        if gate.by_level is not None:
            gate.by_level.weight.copy_(drawn(3, 3) * scale)
    factors = gate.factors(x).detach()
    assert float(factors.min()) >= 0.0 and float(factors.max()) <= 2.0
    torch.testing.assert_close(gate(x), x * factors[:, :, None])
    assert gate(x).shape == x.shape


def test_a_new_gate_changes_nothing() -> None:
    x = drawn(2, 4, 8)
    torch.testing.assert_close(DenoisingGate(4)(x), x)


def test_the_dynamic_gate_does_not_see_the_overall_level() -> None:
    gate, x = DenoisingGate(4), drawn(2, 4, 64)
    assert gate.by_level is not None
    with torch.no_grad():
        gate.by_level.weight.copy_(0.1 * drawn(4, 4, seed=1))
    torch.testing.assert_close(gate.factors(x), gate.factors(7 * x), atol=1e-5, rtol=1e-5)
    louder = x.clone()
    louder[:, 0] *= 7
    assert (gate.factors(x) - gate.factors(louder)).abs().max() > 0.01


@pytest.mark.parametrize(
    ("value", "gradient", "passes"),
    [(0.5, 1.0, True), (-1.0, 1.0, False), (-1.0, -1.0, True), (3.0, 1.0, True), (3.0, -1.0, False)],
)
def test_a_clipped_factor_can_return_and_goes_no_further(value: float, gradient: float, passes: bool) -> None:
    x = torch.tensor([value], requires_grad=True)
    y = clipped(x, 0.0, 2.0)
    assert float(y.detach()) == min(max(value, 0.0), 2.0)
    (gradient * y).sum().backward()
    assert x.grad is not None
    assert float(x.grad) == (gradient if passes else 0.0)


# -- attention --------------------------------------------------------------------------------------------------------


def test_cosine_scores_against_a_plain_loop() -> None:
    q, k = drawn(2, 5, 7), drawn(2, 5, 7, seed=1)
    found = cosine_scores(q, k)
    for b in range(2):
        for i in range(5):
            for j in range(5):
                one, other = q[b, i].double().numpy(), k[b, j].double().numpy()
                dot = sum(float(u) * float(v) for u, v in zip(one, other, strict=True))
                lengths = math.sqrt(sum(u * u for u in one)) * math.sqrt(sum(v * v for v in other))
                assert float(found[b, i, j]) == pytest.approx(dot / lengths, abs=1e-6)
    assert float(found.abs().max()) <= 1 + 1e-6
    torch.testing.assert_close(cosine_scores(3 * q, 0.2 * k), found)
    torch.testing.assert_close(scaled_dot_scores(3 * q, k), 3 * scaled_dot_scores(q, k))
    assert float(scaled_dot_scores(q, k)[1, 2, 3]) == pytest.approx(
        float((q[1, 2] * k[1, 3]).sum()) / math.sqrt(7), abs=1e-6
    )


@pytest.mark.parametrize("cosine", [True, False])
def test_mapping_attention_against_a_plain_loop(cosine: bool) -> None:
    with reproducible(3):
        attention = MappingAttention(6, 32, 8, cosine)
    x = drawn(2, 6, 32)
    weights = attention.weights(x)
    torch.testing.assert_close(weights.sum(dim=2), torch.ones(2, 6))
    tokens = attention.embedding(x)
    assert tokens.shape == (2, 6, 8)
    query, key = attention.query(tokens), attention.key(tokens)
    mixed = torch.zeros_like(x)
    for b in range(2):
        for i in range(6):
            scores = []
            for j in range(6):
                dot = (query[b, i] * key[b, j]).sum()
                scores.append(
                    10 * dot / (query[b, i].norm() * key[b, j].norm()) if cosine else dot / math.sqrt(8)
                )  # fmt: skip
            share = torch.stack(scores).softmax(0)
            torch.testing.assert_close(weights[b, i], share, atol=1e-5, rtol=1e-5)
            for j in range(6):
                mixed[b, i] += share[j] * x[b, j]
    torch.testing.assert_close(attention(x), attention.norm(x + mixed), atol=1e-4, rtol=1e-4)


def test_mapping_attention_does_not_care_about_the_order_of_mappings() -> None:
    with reproducible(3):
        attention = MappingAttention(6, 32, 8, cosine=True)
    x, order = drawn(2, 6, 32), [3, 0, 5, 1, 4, 2]
    torch.testing.assert_close(attention(x)[:, order], attention(x[:, order]), atol=1e-5, rtol=1e-5)


def test_time_attention_mixes_moments() -> None:
    with reproducible(3):
        attention = TimeAttention(3, 32, 8)
    x = drawn(1, 3, 32)
    y = x.clone()
    y[:, 0, 28:] += 5.0  # the last patch
    moved = (attention(x) - attention(y)).abs()
    assert moved[0, 2, :4].max() > 1e-6, "the first patch hears of the last"


# -- alignment --------------------------------------------------------------------------------------------------------


def test_discrepancy_against_a_plain_loop() -> None:
    a, b = drawn(5, 3), 0.5 + drawn(4, 3, seed=1)
    u, v = drawn(5, 2, seed=2).abs(), drawn(4, 2, seed=3).abs()
    both = torch.cat([a, b]).double()
    scale = torch.cdist(both, both).square().mean()

    def kernel(x: Tensor, y: Tensor) -> float:
        return sum(float(torch.exp(-(x - y).square().sum() / (scale * w))) for w in BANDWIDTHS)

    def loop(p: Tensor, q: Tensor) -> float:
        p, q = p / p.sum(), q / q.sum()
        one = [(float(p[i] * p[j]), kernel(both[i], both[j])) for i in range(5) for j in range(5) if i != j]
        two = [(float(q[i] * q[j]), kernel(both[5 + i], both[5 + j])) for i in range(4) for j in range(4) if i != j]
        between = sum(float(p[i] * q[j]) * kernel(both[i], both[5 + j]) for i in range(5) for j in range(4))
        return sum(sum(w * k for w, k in pairs) / sum(w for w, _ in pairs) for pairs in (one, two)) - 2 * between

    expected = (loop(u[:, 0], v[:, 0]) + loop(u[:, 1], v[:, 1])) / 2
    assert float(kernel_discrepancy(a, b, u, v)) == pytest.approx(expected, rel=1e-4)
    assert float(kernel_discrepancy(a, b)) == pytest.approx(loop(torch.ones(5), torch.ones(4)), rel=1e-4)


def test_discrepancy_of_domains_alike_is_nought_in_the_mean() -> None:
    alike = [float(kernel_discrepancy(drawn(16, 4, seed=2 * i), drawn(16, 4, seed=2 * i + 1))) for i in range(200)]
    error = float(np.std(alike) / np.sqrt(200))
    assert abs(np.mean(alike)) < 4 * error and error < 0.02
    apart = [float(kernel_discrepancy(drawn(16, 4, seed=i), 1 + drawn(16, 4, seed=i + 500))) for i in range(20)]
    assert min(apart) > 0.2


@pytest.mark.parametrize("left", [0, 1])
def test_a_class_without_a_pair_of_windows_is_left_out(left: int) -> None:
    a, b = drawn(5, 3), drawn(4, 3, seed=1)
    u, v = torch.ones(5, 2), torch.ones(4, 2)
    u[:, 1] = 0
    u[:left, 1] = 1
    torch.testing.assert_close(kernel_discrepancy(a, b, u, v), kernel_discrepancy(a, b))
    u = torch.zeros(5, 2)
    assert float(kernel_discrepancy(a, b, u, v)) == 0.0, "nothing left, nothing added"


def test_categories_pull_equal_classes_only() -> None:
    """Two classes, swapped between the domains: as wholes they agree, class by class they do not."""
    source = torch.tensor([[0.0], [0.1], [5.0], [5.1]])
    labels = torch.tensor([0, 0, 1, 1])
    swapped = torch.tensor([[-9.0, 9.0], [-9.0, 9.0], [9.0, -9.0], [9.0, -9.0]])
    own = nn.functional.one_hot(labels, 2).float()
    assert float(kernel_discrepancy(source, source)) < 0.01
    assert float(kernel_discrepancy(source, source, own, swapped.softmax(1))) > 1.0


@pytest.mark.parametrize("kinds", [("features",), ("conditional",), ("features", "conditional")])
def test_reversed_gradients_have_the_opposite_sign(kinds: tuple[str, ...]) -> None:
    """The discriminators descend their loss; what comes before them climbs it, in proportion to the weight."""
    with reproducible(0):
        aligner = Aligner(Alignment(kinds), 3)  # type: ignore[arg-type]
    logits, labels = drawn(4, 3), torch.tensor([0, 1, 2, 0])
    gradients: dict[float, Tensor] = {}
    own: dict[float, Tensor] = {}
    for weight in (-1.0, 0.0, 0.5, 1.0):  # -1 undoes the reversal
        features = drawn(8, FEATURES, seed=2).requires_grad_()
        aligner.zero_grad()
        loss, told = aligner(BatchOutputs(features[:4], logits), labels, BatchOutputs(features[4:], logits), weight)
        loss.backward()
        assert features.grad is not None and told is not None and 0 <= float(told) <= 1
        gradients[weight] = features.grad
        own[weight] = torch.cat([p.grad.flatten() for p in aligner.parameters() if p.grad is not None])
    assert gradients[-1.0].abs().max() > 0
    torch.testing.assert_close(gradients[1.0], -gradients[-1.0])
    torch.testing.assert_close(gradients[0.5], 0.5 * gradients[1.0])
    assert not gradients[0.0].any()
    torch.testing.assert_close(own[1.0], own[-1.0])
    torch.testing.assert_close(own[0.0], own[-1.0])

    def domain_loss(features: Tensor) -> float:
        return float(
            aligner(BatchOutputs(features[:4], logits), labels, BatchOutputs(features[4:], logits), 1.0)[0].detach()
        )

    start = drawn(8, FEATURES, seed=2)
    step = gradients[1.0] / gradients[1.0].norm()
    assert domain_loss(start - 0.1 * step) > domain_loss(start), "descending the reversed gradient hides the domain"
