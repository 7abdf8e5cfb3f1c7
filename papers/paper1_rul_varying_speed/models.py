"""The five models that the paper compares, as options of one network.

                   sequence  speed  adversarial
CNN                no        no     no
DANN               no        no     yes
Proposed model 1   no        yes    no
Proposed model 2   yes       no     no
Proposed model 3   yes       yes    yes
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from papers.paper1_rul_varying_speed.methods.architecture import PRINTED_STRIDES, LifeArchitecture
from twingap.errors import TwingapError

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
    """The network of one model; `printed`: table 1 to the letter, 32 features, instead of the text's 112.

    Raises `TwingapError` for an unknown model.
    """
    if name not in models:
        raise TwingapError(f"no model {name!r}", where="models", mend=f"choose from {', '.join(models)}")
    return replace(models[name], strides=PRINTED_STRIDES) if printed else models[name]
