"""Attention over mappings (paper 3), and ordinary attention over time for comparison.

mappings [batch, C, L] --embedding--> tokens --scores--> A, rows sum to 1 --> norm(X + A X) [batch, C, L]

Inverse embedding (section 3.3 of paper 3, after the inverted transformer, Liu et al. 2023, arXiv:2310.06625): a token
is the complete series of one mapping, so A is [C, C] and weighs mappings. Unified embedding (ordinary attention): a
token is a patch of time across all mappings, so A is [L/P, L/P] and weighs times. In both, A multiplies the mappings
themselves ("mapping matrix is multiplied by the normalised attention score matrix"), so that later convolutions still
act over time.
"""

from __future__ import annotations

import math
from typing import Final

import torch
from torch import Tensor, nn

PATCH: Final = 4
"""Samples of the mappings per token of the ordinary attention."""


def scaled_dot_scores(query: Tensor, key: Tensor) -> Tensor:
    """Scores q k^T / sqrt(d) of tokens [..., tokens, d]: [..., tokens, tokens]."""
    return query @ key.transpose(-1, -2) / math.sqrt(query.shape[-1])


def cosine_scores(query: Tensor, key: Tensor) -> Tensor:
    """Cosines of the angles between tokens [..., tokens, d]: [..., tokens, tokens], -1 to 1."""
    return nn.functional.normalize(query, dim=-1) @ nn.functional.normalize(key, dim=-1).transpose(-1, -2)


class InverseEmbedding(nn.Module):
    """Embedding of the series of each mapping as one token, by a shared perceptron: [batch, C, L] -> [batch, C, d]."""

    def __init__(self, length: int, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(length, width), nn.GELU(), nn.Linear(width, width), nn.LayerNorm(width))

    def forward(self, mappings: Tensor) -> Tensor:
        """Tokens."""
        tokens: Tensor = self.layers(mappings)
        return tokens


class MappingAttention(nn.Module):
    """Self-attention across mappings on inverse embeddings: [batch, C, L] -> [batch, C, L].

    Parameters
    ----------
    channels, length : int
        C, L.
    width : int
        Width of the tokens.
    cosine : bool
        Whether scores are cosines times a learnt factor (10 at first, since cosines alone give nearly equal weights);
        otherwise scaled dot products.
    """

    def __init__(self, channels: int, length: int, width: int, cosine: bool) -> None:
        super().__init__()
        self.embedding = InverseEmbedding(length, width)
        self.query, self.key = nn.Linear(width, width), nn.Linear(width, width)
        self.log_sharpness = nn.Parameter(torch.tensor(math.log(10.0))) if cosine else None
        self.norm = nn.GroupNorm(1, channels)

    def weights(self, mappings: Tensor) -> Tensor:
        """Attention matrix [batch, C, C]; rows sum to 1."""
        tokens = self.embedding(mappings)
        query, key = self.query(tokens), self.key(tokens)
        if self.log_sharpness is None:
            return scaled_dot_scores(query, key).softmax(dim=-1)
        return (self.log_sharpness.exp() * cosine_scores(query, key)).softmax(dim=-1)

    def forward(self, mappings: Tensor) -> Tensor:
        """Normalised sum of each mapping and those that it attends to."""
        joined: Tensor = self.norm(mappings + self.weights(mappings) @ mappings)
        return joined


class TimeAttention(nn.Module):
    """Ordinary scaled dot-product self-attention across time: [batch, C, L] -> [batch, C, L].

    Parameters
    ----------
    channels, length : int
        C, L, a multiple of 4.
    width : int
        Width of the tokens.
    """

    def __init__(self, channels: int, length: int, width: int) -> None:
        super().__init__()
        if length % PATCH:
            raise ValueError(f"length = {length}, a multiple of {PATCH} expected")
        self.embedding = nn.Linear(channels * PATCH, width)
        self.place = nn.Parameter(0.02 * torch.randn(length // PATCH, width))
        self.query, self.key = nn.Linear(width, width), nn.Linear(width, width)
        self.norm = nn.GroupNorm(1, channels)

    def forward(self, mappings: Tensor) -> Tensor:
        """Normalised sum of each time and those that it attends to."""
        batch, channels, length = mappings.shape
        by_patch = mappings.reshape(batch, channels, length // PATCH, PATCH)
        patches = by_patch.transpose(1, 2).flatten(2)  # [batch, L/P, C P]
        tokens = self.embedding(patches) + self.place
        weights = scaled_dot_scores(self.query(tokens), self.key(tokens)).softmax(dim=-1)
        spread = (weights @ patches).reshape(batch, length // PATCH, channels, PATCH).transpose(1, 2).flatten(2)
        joined: Tensor = self.norm(mappings + spread)
        return joined
