"""Network for remaining life without torch: sizes of the five models that the paper compares, and the encodings of a
record's place in the run and of its speed (eq. 13; Vaswani et al. 2017, arXiv:1706.03762)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from papers.arrays import Array
from twingap import Bearing, TwingapError

D_MODEL = 24  # length of each encoding (table 4)
LENGTH = 25000  # samples of a record (table 4)
PRINTED_STRIDES = (16, 8)  # strides of table 1 as printed: 32 features instead of 112


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


def critical_length(bearing: Bearing, lowest_speed_rpm: float, fs_hz: float, impacts: int = 1) -> int:
    """Samples that hold so many impacts of a ball defect, the rarest, at the lowest speed: L_c = F_s / BSF, eq. 16,
    which counts one impact a spin. A 6205 at 1000 rpm and 50 kHz needs 25,459 samples for 20; 25,000 hold 19.6."""
    if not (lowest_speed_rpm > 0 and fs_hz > 0 and impacts > 0):
        raise TwingapError(
            f"{lowest_speed_rpm:g} rpm, {fs_hz:g} Hz, {impacts} impacts: all must be above 0", where="critical length"
        )
    return math.ceil(impacts * fs_hz / (bearing.bsf * lowest_speed_rpm / 60))


MODELS: Final[Mapping[str, LifeArchitecture]] = MappingProxyType({
    "CNN": LifeArchitecture(sequence=False, speed=False, adversarial=False),
    "DANN": LifeArchitecture(sequence=False, speed=False, adversarial=True),
    "Proposed model 1": LifeArchitecture(sequence=False, speed=True, adversarial=False),
    "Proposed model 2": LifeArchitecture(sequence=True, speed=False, adversarial=False),
    "Proposed model 3": LifeArchitecture(sequence=True, speed=True, adversarial=True),
})  # fmt: skip
"""Columns of table 5, in its order, with the 112 features of the text."""


def architecture_of(
    name: str, *, printed: bool = False, models: Mapping[str, LifeArchitecture] = MODELS
) -> LifeArchitecture:
    """The network of one model; `printed`: table 1 to the letter, 32 features, instead of the text's 112."""
    if name not in models:
        raise TwingapError(f"no model {name!r}", where="models", mend=f"choose from {', '.join(models)}")
    return replace(models[name], strides=PRINTED_STRIDES) if printed else models[name]


def positional_encoding(position: ArrayLike, d_model: int = D_MODEL) -> Array:
    """PE(pos, 2i) = sin(pos / 10000^(2i / d_model)), PE(pos, 2i + 1) = cos of the same, positions from 1: eq. 13 [...,
    d_model]."""
    if d_model < 2 or d_model % 2:
        raise TwingapError(f"d_model = {d_model}, an even number of at least 2 expected", where="encoding")
    angle = np.asarray(position, float)[..., None] / 10000.0 ** (np.arange(0, d_model, 2) / d_model)
    return np.stack((np.sin(angle), np.cos(angle)), axis=-1).reshape(*angle.shape[:-1], d_model)


def speed_position(speed_rpm: ArrayLike, speeds_rpm: ArrayLike) -> Array:
    """Position of speeds [...] among the increasing operating speeds: that of the nearest, 1 for the lowest."""
    speed, known = np.asarray(speed_rpm, float), np.asarray(speeds_rpm, float)
    if known.ndim != 1 or known.size == 0 or (np.diff(known) <= 0).any():
        raise TwingapError("increasing speeds expected", where="operating speeds")
    middles = (known[1:] + known[:-1]) / 2
    return np.asarray(np.searchsorted(middles, speed, side="right"), float) + 1.0
