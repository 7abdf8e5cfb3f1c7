"""Remaining life: health indicators, damage growth, what a network is told and what it predicts.

peak to peak, speed --> S(k) --> normalised --> anomaly --> D(k) --> lives to simulate, with labels
record, place in the run, speed --encodings--> LifeNetwork --> remaining revolutions --> remaining time

Equations of paper 1 by number: 1 `twins.paper1_chain`; 5 `bearing`; 6 `objective`, `descended`; 7 `regression_loss`,
`domain_loss`; 8 `healthy_mode` (`identify.equation_8`); 9 `speed_constants`, `fit_speed_influence`; 10
`SpeedInfluence.amplitude`; 11 `normalised_peak_to_peak`; 12 `damage`, `fit_damage`; 13 `positional_encoding`; 14
`remaining_revolutions`, `remaining_time_s`; 15 `domain_loss`; 16 `critical_length`. The network and its losses need
torch and are imported from `prognosis.network` and `prognosis.losses`.
"""

from twingap.prognosis.anomaly import Anomaly, AnomalyRule, detect_anomaly, deviations
from twingap.prognosis.architecture import PRINTED_STRIDES, LifeArchitecture
from twingap.prognosis.critical_length import critical_length
from twingap.prognosis.degradation import DamageFit, Trajectory, damage, end_row, fit_damage, trajectories
from twingap.prognosis.encoding import D_MODEL, positional_encoding, sequence_position, speed_position
from twingap.prognosis.healthy import healthy_mode, logarithmic_decrement_damping
from twingap.prognosis.remaining_life import remaining_revolutions, remaining_time_s, revolutions_in, time_along
from twingap.prognosis.speed_influence import (
    SpeedInfluence,
    fit_speed_influence,
    normalised_peak_to_peak,
    speed_constants,
)

__all__ = [
    "D_MODEL",
    "PRINTED_STRIDES",
    "Anomaly",
    "AnomalyRule",
    "DamageFit",
    "LifeArchitecture",
    "SpeedInfluence",
    "Trajectory",
    "critical_length",
    "damage",
    "detect_anomaly",
    "deviations",
    "end_row",
    "fit_damage",
    "fit_speed_influence",
    "healthy_mode",
    "logarithmic_decrement_damping",
    "normalised_peak_to_peak",
    "positional_encoding",
    "remaining_revolutions",
    "remaining_time_s",
    "revolutions_in",
    "sequence_position",
    "speed_constants",
    "speed_position",
    "time_along",
    "trajectories",
]
