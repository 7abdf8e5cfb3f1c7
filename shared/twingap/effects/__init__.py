"""Catalogue of effects: modelling choices, from slip to clipping, each of which acts in one stage of a record."""

from twingap.effects.base import Effect, Stage, effect_name, parameter, profile
from twingap.effects.draft import Draft, Impacts
from twingap.effects.modes import Mode
from twingap.effects.registry import catalogue, in_order, load_effects, make_effect, register, trainable

# Importing a module registers its effect: in the order of the chain, and within a stage of their acting.
from twingap.effects.speed_fluctuation import SpeedFluctuation  # isort: skip
from twingap.effects.mean_slip import MeanSlip  # isort: skip
from twingap.effects.slip_jitter import SlipJitter  # isort: skip
from twingap.effects.impact_scatter import ImpactScatter  # isort: skip
from twingap.effects.load_zone import LoadZone  # isort: skip
from twingap.effects.cage_modulation import CageModulation  # isort: skip
from twingap.effects.entry_exit import EntryExit  # isort: skip
from twingap.effects.distributed_roughness import DistributedRoughness  # isort: skip
from twingap.effects.speed_gain import SpeedGain  # isort: skip
from twingap.effects.damage_growth import DamageGrowth  # isort: skip
from twingap.effects.second_resonance import SecondResonance  # isort: skip
from twingap.effects.sensor_rolloff import SensorRolloff  # isort: skip
from twingap.effects.shaft_harmonics import ShaftHarmonics  # isort: skip
from twingap.effects.looseness import Looseness  # isort: skip
from twingap.effects.mains_interference import MainsInterference  # isort: skip
from twingap.effects.drive_interference import DriveInterference  # isort: skip
from twingap.effects.gear_mesh import GearMesh  # isort: skip
from twingap.effects.foreign_bearing import ForeignBearing  # isort: skip
from twingap.effects.coloured_noise import ColouredNoise  # isort: skip
from twingap.effects.impulsive_noise import ImpulsiveNoise  # isort: skip
from twingap.effects.waviness import Waviness  # isort: skip
from twingap.effects.clipping import Clipping  # isort: skip
from twingap.effects.quantisation import Quantisation  # isort: skip
from twingap.effects.dropout import Dropout  # isort: skip

# Without detectors: parts of the closest twin, which act after the others of their stage.
from twingap.effects.impulsive_share import ImpulsiveShare  # isort: skip
from twingap.effects.ball_contact import BallContact  # isort: skip
from twingap.effects.transfer_path import TransferPath  # isort: skip
from twingap.effects.line_spectrum import LineSpectrum  # isort: skip
from twingap.effects.background_spectrum import BackgroundSpectrum  # isort: skip
from twingap.effects.sample_hold import SampleHold  # isort: skip
from twingap.effects.on_waveform import apply_to_waveform  # isort: skip

__all__ = [
    "BackgroundSpectrum", "BallContact", "CageModulation", "Clipping", "ColouredNoise", "DamageGrowth",
    "DistributedRoughness", "Draft", "DriveInterference", "Dropout", "Effect", "EntryExit", "ForeignBearing",
    "GearMesh", "ImpactScatter", "Impacts", "ImpulsiveNoise", "ImpulsiveShare", "LineSpectrum", "LoadZone",
    "Looseness", "MainsInterference", "MeanSlip", "Mode", "Quantisation", "SampleHold", "SecondResonance",
    "SensorRolloff", "ShaftHarmonics", "SlipJitter", "SpeedFluctuation", "SpeedGain", "Stage", "TransferPath",
    "Waviness", "apply_to_waveform", "catalogue", "effect_name", "in_order", "load_effects", "make_effect",
    "parameter", "profile", "register", "trainable",
]  # fmt: skip
