"""The catalogue of effects: every modelling choice, from slip to clipping, one object that acts in one stage."""

from twingap.effects.base import (
    Effect,
    Stage,
    catalogue,
    effect_name,
    in_order,
    make_effect,
    parameter,
    register,
)
from twingap.effects.draft import Draft, Impacts
from twingap.effects.ringing import Mode

__all__ = [
    "Draft",
    "Effect",
    "Impacts",
    "Mode",
    "Stage",
    "catalogue",
    "effect_name",
    "in_order",
    "make_effect",
    "parameter",
    "register",
]
