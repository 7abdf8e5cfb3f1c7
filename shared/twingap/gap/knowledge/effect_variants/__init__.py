"""Effects as a machine has them: nature is not bound to how the catalogue makes one.

effect of the catalogue --at random--> the same effect, made otherwise, at the same values

What is learnt from machines that have effects exactly as the twin would add them fails on machines that do not. Every
class of this package bears the name of what it stands for, since effects are known by the names of their classes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Final

import numpy as np

from twingap.effects import Effect
from twingap.gap.knowledge.effect_variants import disturbances, impacts, sensors
from twingap.gap.knowledge.effect_variants.maker import Maker
from twingap.gap.knowledge.machines import Machine

CHANCE: Final = 0.25
"""Part of the machines that have an effect otherwise than the catalogue makes it: the more they are, the less surely
the catalogue's own form is heard from as many machines."""
OTHERWISE: Final[Mapping[str, Maker]] = {**impacts.OTHERWISE, **disturbances.OTHERWISE, **sensors.OTHERWISE}
"""Name of an effect -> another form of it from its values, for a machine; None where these values have none."""


def as_built(effect: Effect, machine: Machine, rng: np.random.Generator) -> Effect:
    """The effect as one machine has it.

    Parameters
    ----------
    effect : Effect
        Of the catalogue.
    machine : Machine
    rng : numpy.random.Generator
    """
    maker = OTHERWISE.get(effect.name)
    if maker is None or rng.random() >= CHANCE:
        return effect
    values = {f.name: getattr(effect, f.name) for f in dataclasses.fields(effect)}  # type: ignore[arg-type]
    return maker(values, machine, rng) or effect
