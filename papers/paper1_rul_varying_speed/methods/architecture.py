"""Parts and sizes of the network for remaining life, without torch: the five models that the paper compares."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from papers.paper1_rul_varying_speed.methods.encoding import D_MODEL
from twingap import Bearing, TwingapError

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
