"""The catalogue of effects: every modelling choice, from slip to clipping, one object that acts in one stage."""

from twingap.effects.base import Effect, Stage, effect_name, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.registry import catalogue, in_order, load_effects, make_effect, register
from twingap.effects.ringing import Mode

# Importing a module registers its effects: in the order of the chain, and within a stage of their acting.
from twingap.effects.shaft import MeanSlip, SpeedFluctuation  # isort: skip
from twingap.effects.excitation import (  # isort: skip
    CageModulation,
    DamageGrowth,
    DistributedRoughness,
    EntryExit,
    ImpactScatter,
    LoadZone,
    SlipJitter,
    SpeedGain,
)
from twingap.effects.path import SecondResonance, SensorRolloff  # isort: skip
from twingap.effects.disturbance import (  # isort: skip
    ColouredNoise,
    DriveInterference,
    ForeignBearing,
    GearMesh,
    ImpulsiveNoise,
    Looseness,
    MainsInterference,
    ShaftHarmonics,
    Waviness,
)
from twingap.effects.acquisition import Clipping, Dropout, Quantisation  # isort: skip
from twingap.effects.on_waveform import apply_to_waveform  # isort: skip

__all__ = [
    "CageModulation",
    "Clipping",
    "ColouredNoise",
    "DamageGrowth",
    "DistributedRoughness",
    "Draft",
    "DriveInterference",
    "Dropout",
    "Effect",
    "EntryExit",
    "ForeignBearing",
    "GearMesh",
    "ImpactScatter",
    "Impacts",
    "ImpulsiveNoise",
    "LoadZone",
    "Looseness",
    "MainsInterference",
    "MeanSlip",
    "Mode",
    "Quantisation",
    "SecondResonance",
    "SensorRolloff",
    "ShaftHarmonics",
    "SlipJitter",
    "SpeedFluctuation",
    "SpeedGain",
    "Stage",
    "Waviness",
    "apply_to_waveform",
    "catalogue",
    "effect_name",
    "in_order",
    "load_effects",
    "make_effect",
    "parameter",
    "register",
]
