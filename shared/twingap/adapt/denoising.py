"""Multi-scale mode denoising network: small convolutions, fusion across branches, a gate for each channel.

modes [batch, K, N] --branches--> [batch, C, N/4] --fusion--> [batch, C, N/8] --gate--> mappings [batch, C, N/8]

C = K modes x branches x maps. Every mapping belongs to one mode up to here (all convolutions are grouped by modes);
modes meet in the attention that follows. Source: section 3.2 of paper 3 (DOI 10.1177/10775463261462852), whose
equations and sizes its text does not give; each block states how it was read.
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
        # Descent moves against the gradient: a positive one would push further below, a negative one further above.
        outward = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
        return gradient.masked_fill(outward, 0.0), None, None


def clipped(x: Tensor, low: float, high: float) -> Tensor:
    """`x` clipped to [low, high]; gradients that would push it further out are dropped, those that bring it back pass.

    `torch.clamp` drops both, and a factor that has once left the range would stay where it is for good.
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
        Odd, one a branch; at least the stride, so that every sample is seen.
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
        # All branches as one convolution, short kernels padded with zeros: three times faster than one after the other.
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
    """What branches saw brought together: [batch, C, L] -> [batch, C, L/2].

    A depthwise convolution looks further along each mapping alone; a group convolution mixes the branches of each mode.
    Their sum sees both receptive fields.

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
    """Each channel times a learnt factor that cannot leave a range: [batch, C, L] -> [batch, C, L].

    factor = clip(scale_c + (W log(level))_c, low, high), level = rms of each channel. The scale is a parameter of the
    channel, 1 at first. "Dynamic" is read as: the factor also depends on the sample at hand, here on how loud its
    channels are relative to each other; W is 0 at first. "Constrained through weight pruning" is read as clipping.
    Scaling a channel's series scales all amplitudes of its spectrum alike, so it does not matter in which of the two
    the product is taken.

    Parameters
    ----------
    channels : int
    low, high : float
        Range of the factor.
    dynamic : bool
        With W.
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
    """Branches, fusion, gate: modes [batch, K, N] -> mappings [batch, C, N/8].

    Parameters
    ----------
    modes : int
    kernels : sequence of int
    maps : int
        As in `CompactBranches`.
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
    """What stands where the denoising network is left out: one strided convolution, [batch, K, N] -> [batch, C, N/8].

    It has the denoising network's output shape, so that all that follows is the same with and without it.

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
