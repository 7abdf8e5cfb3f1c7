"""Parts and sizes of the network for remaining life, without torch.

samples, kernels, strides, pools --> features of a record --> joined with the encodings: what the layers behind see
"""

from __future__ import annotations

from dataclasses import dataclass

from papers.paper1_rul_varying_speed.methods.encoding import D_MODEL

LENGTH = 25000
"""Samples of a record (table 4)."""

PRINTED_STRIDES = (16, 8)
"""Strides of table 1 as printed: 32 features instead of 112."""


@dataclass(frozen=True)
class LifeArchitecture:
    """Which parts the network has, and their sizes."""

    sequence: bool = True  # sequence, speed: whether the record's place in the run, and its speed, are inputs
    speed: bool = True
    adversarial: bool = True  # whether a discriminator with gradient reversal takes part
    length: int = LENGTH  # samples of a record
    d_model: int = D_MODEL  # length of each encoding
    # filters, kernels, strides, pools: of the two convolutions, and of the max-pool after each (its width and stride).
    # Table 1 prints a second stride of 8, which leaves 32 features of 25,000 samples where the text says 112; a stride
    # of 3, the default here, leaves 112 (so does 6 with a last pool of 4). PRINTED_STRIDES are table 1 to the letter.
    filters: tuple[int, int] = (4, 16)
    kernels: tuple[int, int] = (128, 16)
    strides: tuple[int, int] = (16, 3)
    pools: tuple[int, int] = (8, 8)
    reversal: float = 0.1  # lambda: weight of the reversed gradient

    @property
    def features(self) -> int:
        """Features of a record after flattening."""
        size = self.length
        for kernel, stride, pool in zip(self.kernels, self.strides, self.pools, strict=True):
            size = ((size - kernel) // stride + 1 if size >= kernel else 0) // pool
        return size * self.filters[1]

    @property
    def joined(self) -> int:
        """Features and encodings together: what regressor and discriminator see."""
        return self.features + self.d_model * (self.sequence + self.speed)
