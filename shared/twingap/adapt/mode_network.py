"""Network on variational modes: denoising, attention and classifier, with options to leave parts out.

modes [batch, K, N] -> denoising (or lift) -> [batch, C, N/8] -> attention (or none) -> convolutional feed-forward
    extractor -> features [batch, 100] -> classifier -> logits [batch, classes]

With K = 4, three branches and two maps C = 24; N = 2048 makes mappings of 256 samples. The last two stages are part
of every variant, so that variants differ only in the part that is left out. Source: section 3 of paper 3, DOI
10.1177/10775463261462852, whose text does not give the sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import torch
from torch import Tensor, nn

from twingap.adapt.attention import PATCH, MappingAttention, TimeAttention
from twingap.adapt.denoising import STRIDE, DenoisingNetwork, Lift
from twingap.adapt.nets import FEATURES

STRETCHES: Final = 4
"""Number of equal intervals of time over which the last maps are averaged; more keep more of their position."""
MULTIPLE: Final = STRIDE * PATCH
SHORTEST: Final = 8 * STRETCHES * STRIDE
"""The length of an input is a multiple of `MULTIPLE` and at least `SHORTEST`."""
AttentionKind = Literal["none", "time", "mappings", "cosine"]


@dataclass(frozen=True)
class Architecture:
    """Parts of the network and their sizes.

    Parameters
    ----------
    denoising : bool
        Whether to use the multi-scale mode denoising network; otherwise a strided convolution.
    attention : {"none", "time", "mappings", "cosine"}
        No attention; ordinary attention across time; scaled dot products across mappings (inverse embedding without the
        cosine); the paper's.
    kernels : tuple[int, ...]
        Kernel lengths of the branches.
    maps : int
        Mappings per mode and branch.
    width : int
        Width of the attention's tokens.
    """

    denoising: bool = True
    attention: AttentionKind = "cosine"
    kernels: tuple[int, ...] = (5, 7, 9)
    maps: int = 2
    width: int = 64


class FeedForwardExtractor(nn.Module):
    """Convolutional feed-forward extractor: [batch, C, L] -> [batch, 100].

    A depthwise convolution for each mapping, [C, L/2]; three convolutions across mappings, [32, L/2], [48, L/4],
    [64, L/8]; averages over 4 equal intervals of time; one linear layer. At 12 kHz its receptive field, with the
    strides before it, is 50 ms: five impacts of an outer race, so that their rate can be recognised.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.convolutions = nn.Sequential(
            nn.Conv1d(channels, channels, 9, stride=2, padding=4, groups=channels),
            nn.Conv1d(channels, 32, 1), nn.GroupNorm(4, 32), nn.ReLU(),
            nn.Conv1d(32, 48, 9, stride=2, padding=4), nn.GroupNorm(4, 48), nn.ReLU(),
            nn.Conv1d(48, 64, 9, stride=2, padding=4), nn.GroupNorm(4, 64), nn.ReLU(),
        )  # fmt: skip
        self.out = nn.Linear(64 * STRETCHES, FEATURES)

    def forward(self, x: Tensor) -> Tensor:
        """Features."""
        maps = self.convolutions(x)
        # Averages over equal stretches: unlike adaptive pooling, deterministic on a GPU.
        stretches = maps[:, :, : maps.shape[2] // STRETCHES * STRETCHES].unflatten(2, (STRETCHES, -1)).mean(dim=3)
        features: Tensor = torch.relu(self.out(stretches.flatten(1)))
        return features


class ModeNetwork(nn.Module):
    """Modes [batch, K, N] -> logits [batch, classes].

    Parameters
    ----------
    architecture : Architecture
    length : int
        N, a multiple of 32, at least 256.
    modes : int
        K.
    n_classes : int
    """

    def __init__(self, architecture: Architecture, length: int, modes: int, n_classes: int) -> None:
        super().__init__()
        if length % MULTIPLE or length < SHORTEST:
            raise ValueError(f"length = {length}, a multiple of {MULTIPLE} and at least {SHORTEST} expected")
        a, shorter = architecture, length // STRIDE
        channels = modes * a.maps * len(a.kernels)
        stages: dict[str, nn.Module] = {}
        if a.denoising:
            stages["denoising"] = DenoisingNetwork(modes, a.kernels, a.maps)
        else:
            stages["lift"] = Lift(modes, channels)
        if a.attention == "time":
            stages["attention"] = TimeAttention(channels, shorter, a.width)
        elif a.attention != "none":
            stages["attention"] = MappingAttention(channels, shorter, a.width, cosine=a.attention == "cosine")
        stages["feed_forward"] = FeedForwardExtractor(channels)
        self.extractor = nn.Sequential()
        for name, stage in stages.items():
            self.extractor.add_module(name, stage)
        self.classifier = nn.Linear(FEATURES, n_classes)

    def forward(self, x: Tensor) -> Tensor:
        """Logits."""
        logits: Tensor = self.classifier(self.extractor(x))
        return logits
