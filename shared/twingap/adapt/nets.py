"""Compact 1-D convolutional network with a wide first kernel, and the classifier on its features.

input [batch, channels, length] --extractor--> features [batch, 100] --classifier--> logits [batch, classes]

The wide first kernel follows Zhang et al. 2017 (WDCNN, DOI 10.3390/s17020425): wide enough for the
response of a structural mode, followed by small kernels. Normalisation is by groups of channels within a sample (Wu and
He 2018). Batch statistics would mix the domains, so that the discriminator would not be the only difference between
training with and without adaptation.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

FEATURES = 100
"""Number of features before the classifier; more increase the capacity of the network."""


class PlainCNN(nn.Module):
    """Convolutional network with four convolutions, one hidden layer and a linear classifier.

    Parameters
    ----------
    length : int
        Samples of the input, at least 128.
    n_classes : int
    channels : int
        Channels of the input.

    Notes
    -----
    Shapes for one channel of length 2048 (124,424 parameters with four classes):

    ==========================  ==========
    layer                       output
    ==========================  ==========
    input                       1 x 2048
    conv 64 / 8, 16, norm       16 x 256
    max-pool 2                  16 x 128
    conv 3, 32, norm, pool 2    32 x 64
    conv 3, 64, norm, pool 2    64 x 32
    conv 3, 64, norm, pool 2    64 x 16
    flatten, linear, ReLU       100
    linear                      4
    ==========================  ==========
    """

    def __init__(self, length: int, n_classes: int, channels: int = 1) -> None:
        super().__init__()
        if length < 128:
            raise ValueError(f"length = {length}, at least 128 expected")
        layers: list[nn.Module] = [nn.Conv1d(channels, 16, 64, stride=8, padding=28)]
        width, size = 16, (length - 8) // 8 + 1
        layers += [nn.GroupNorm(4, 16), nn.ReLU(), nn.MaxPool1d(2)]
        size //= 2
        for wider in (32, 64, 64):
            layers += [nn.Conv1d(width, wider, 3, padding=1), nn.GroupNorm(4, wider), nn.ReLU(), nn.MaxPool1d(2)]
            width, size = wider, size // 2
        layers += [nn.Flatten(), nn.Linear(width * size, FEATURES), nn.ReLU()]
        self.extractor = nn.Sequential(*layers)
        self.classifier = nn.Linear(FEATURES, n_classes)

    def forward(self, x: Tensor) -> Tensor:
        """Logits [batch, classes] of inputs [batch, channels, length]."""
        logits: Tensor = self.classifier(self.extractor(x))
        return logits


def best_device(wanted: str = "auto") -> torch.device:
    """Device for training: "auto" is a GPU if there is one, else the CPU."""
    if wanted == "auto":
        wanted = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(wanted)
