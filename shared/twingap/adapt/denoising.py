"""Multi-scale mode denoising network: small convolutions, fusion across branches, one gate per channel.

modes [batch, K, N] --branches--> [batch, C, N/4] --fusion--> [batch, C, N/8] --gate--> mappings [batch, C, N/8]

C = K modes x branches x maps. All convolutions are grouped by modes, so that every mapping belongs to one mode; the
attention that follows combines modes. Source: section 3.2 of paper 3 (DOI 10.1177/10775463261462852), whose text gives
no equations and sizes; each block states its interpretation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import torch
from torch import Tensor, nn

STRIDE: Final = 8
"""Samples of a mode per sample of a mapping."""


class _Clipped(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, low: float, high: float) -> Tensor:
        ctx.save_for_backward(x)
        ctx.limits = low, high
        return x.clamp(low, high)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:
        (x,), (low, high), gradient = ctx.saved_tensors, ctx.limits, gradients[0]
        # Descent moves against the gradient: a positive gradient decreases x, a negative one increases it.
        outward = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
        return gradient.masked_fill(outward, 0.0), None, None


def clipped(x: Tensor, low: float, high: float) -> Tensor:
    """`x` clipped to [low, high], with gradients only towards the range.

    `torch.clamp` has no gradient outside the range, so that a factor that has left it could not return.
    """
    result: Tensor = _Clipped.apply(x, low, high)  # type: ignore[no-untyped-call]
    return result


class CompactBranches(nn.Module):
    """Parallel convolutions with small kernels, stride 4: [batch, K, N] -> [batch, C, N/4].

    Parameters
    ----------
    modes : int
        K.
    kernels : sequence of int
        Odd lengths, one per branch, at least the stride, so that every sample is used.
    maps : int
        Mappings per mode and branch; C = K len(kernels) maps, sorted by mode, then branch.
    """

    def __init__(self, modes: int, kernels: Sequence[int], maps: int) -> None:
        super().__init__()
        if any(k % 2 == 0 or k < 4 for k in kernels):
            raise ValueError(f"kernels = {tuple(kernels)}, odd lengths of at least 5 expected")
        self.modes, self.maps = modes, maps
        self.branches = nn.ModuleList(
            nn.Conv1d(modes, modes * maps, k, stride=4, padding=k // 2, groups=modes) for k in kernels
        )
        self.norm = nn.GroupNorm(modes, modes * maps * len(kernels))

    def forward(self, x: Tensor) -> Tensor:
        """Mappings, normalised within each mode of each sample."""
        # All branches as one convolution with zero-padded kernels, which is faster than one after the other.
        branches = [branch for branch in self.branches if isinstance(branch, nn.Conv1d)]
        longest = max(branch.kernel_size[0] for branch in branches)
        weight = torch.stack([self._by_mode(_padded(branch.weight, longest)) for branch in branches], dim=1)
        bias = torch.stack([self._by_mode(branch.bias) for branch in branches if branch.bias is not None], dim=1)
        each = nn.functional.conv1d(
            x, weight.flatten(0, 2), bias.flatten(), stride=4, padding=longest // 2, groups=self.modes
        )
        mappings: Tensor = torch.relu(self.norm(each))
        return mappings

    def _by_mode(self, values: Tensor) -> Tensor:
        """[K maps, ...] -> [K, maps, ...]."""
        return values.reshape(self.modes, self.maps, *values.shape[1:])


def _padded(kernel: Tensor, length: int) -> Tensor:
    aside = (length - kernel.shape[2]) // 2
    return nn.functional.pad(kernel, (aside, aside))


class CrossBranchFusion(nn.Module):
    """Fusion of branches: [batch, C, L] -> [batch, C, L/2].

    A depthwise convolution acts along each mapping; a grouped convolution mixes the branches of each mode. Both are
    added.

    Parameters
    ----------
    modes, channels : int
        K, C.
    """

    def __init__(self, modes: int, channels: int) -> None:
        super().__init__()
        self.depthwise = nn.Conv1d(channels, channels, 5, stride=2, padding=2, groups=channels)
        self.grouped = nn.Conv1d(channels, channels, 3, padding=1, groups=modes)
        self.norm = nn.GroupNorm(modes, channels)

    def forward(self, x: Tensor) -> Tensor:
        """Fused mappings."""
        own = self.depthwise(x)
        fused: Tensor = torch.relu(self.norm(own + self.grouped(torch.relu(own))))
        return fused


class DenoisingGate(nn.Module):
    """Gate that multiplies each channel by a learnt, bounded factor: [batch, C, L] -> [batch, C, L].

    factor = clip(scale_c + (W log(level))_c, low, high), level = rms of each channel. The scale is a parameter of the
    channel, initially 1. "Dynamic" is interpreted as a dependence on the sample, here on the relative levels of its
    channels; W is initially 0. "Constrained through weight pruning" is interpreted as clipping. Multiplying a series is
    equivalent to multiplying its spectrum.

    Parameters
    ----------
    channels : int
    low, high : float
        Range of the factor.
    dynamic : bool
        Whether factors depend on the levels, by W.
    """

    def __init__(self, channels: int, low: float = 0.0, high: float = 2.0, dynamic: bool = True) -> None:
        super().__init__()
        self.low, self.high = low, high
        self.scale = nn.Parameter(torch.ones(channels))
        self.by_level = nn.Linear(channels, channels, bias=False) if dynamic else None
        if self.by_level is not None:
            nn.init.zeros_(self.by_level.weight)

    def factors(self, x: Tensor) -> Tensor:
        """Factors [batch, C] (or [1, C] without the dynamic part)."""
        wanted = self.scale[None]
        if self.by_level is not None:
            level = 0.5 * torch.log(x.square().mean(dim=2) + 1e-6)
            wanted = wanted + self.by_level(level - level.mean(dim=1, keepdim=True))
        return clipped(wanted, self.low, self.high)

    def forward(self, x: Tensor) -> Tensor:
        """Gated mappings."""
        return x * self.factors(x)[:, :, None]


class DenoisingNetwork(nn.Module):
    """Denoising network of branches, fusion and gate: modes [batch, K, N] -> mappings [batch, C, N/8].

    Parameters
    ----------
    modes : int
    kernels : sequence of int
    maps : int
        See `CompactBranches`.
    """

    def __init__(self, modes: int, kernels: Sequence[int], maps: int) -> None:
        super().__init__()
        channels = modes * maps * len(kernels)
        self.branches = CompactBranches(modes, kernels, maps)
        self.fusion = CrossBranchFusion(modes, channels)
        self.gate = DenoisingGate(channels)

    def forward(self, x: Tensor) -> Tensor:
        """Mappings."""
        mappings: Tensor = self.gate(self.fusion(self.branches(x)))
        return mappings


class Lift(nn.Module):
    """Replacement of the denoising network by one strided convolution: [batch, K, N] -> [batch, C, N/8].

    It has the same output shape, so that later stages do not change.

    Parameters
    ----------
    modes, channels : int
        K, C.
    """

    def __init__(self, modes: int, channels: int) -> None:
        super().__init__()
        self.convolution = nn.Conv1d(modes, channels, STRIDE, stride=STRIDE, groups=modes)
        self.norm = nn.GroupNorm(modes, channels)

    def forward(self, x: Tensor) -> Tensor:
        """Mappings."""
        mappings: Tensor = torch.relu(self.norm(self.convolution(x)))
        return mappings
