"""Remaining life: health indicators, damage growth, what a network is told and what it predicts.

peak to peak, speed --> S(k) --> normalised --> anomaly --> D(k) --> lives to simulate, with labels
record, place in the run, speed --encodings--> LifeNetwork --> remaining revolutions --> remaining time
rows of a run, one by one --OnlineLife.update, Prior of other runs--> Estimate; a whole run --follow--> Followed
features of a run --degrade--> Degradation: indicator, fitted curves, forecasts;  predictions, truth --> metrics

Equations of paper 1 by number: 1 `twins.paper1_chain`; 5 `bearing`; 6 `objective`, `descended`; 7 `regression_loss`,
`domain_loss`; 8 `healthy_mode` (`identify.equation_8`); 9 `speed_constants`, `fit_speed_influence`; 10
`SpeedInfluence.amplitude`; 11 `normalised_peak_to_peak`; 12 `damage`, `fit_damage`; 13 `positional_encoding`; 14
`remaining_revolutions`, `remaining_time_s`; 15 `domain_loss`; 16 `critical_length`. The network and its losses need
torch and are imported from `prognosis.network` and `prognosis.losses`.

What a run is differs with what is asked of it, so the three stay in their modules: `run_records` (of `follow`: records
on disk), `health_indicator` (of `degrade`: features), `run` (of `adapt`: amplitude and speed). `follow` and `degrade`
here are the functions.
"""

from twingap.prognosis import metrics
from twingap.prognosis.adaptive_twin import Adaptation, AdaptiveTwin, adapt
from twingap.prognosis.anomaly import Anomaly, AnomalyRule, detect_anomaly, deviations
from twingap.prognosis.architecture import PRINTED_STRIDES, LifeArchitecture
from twingap.prognosis.critical_length import critical_length
from twingap.prognosis.degradation import DamageFit, Trajectory, damage, end_row, fit_damage, trajectories
from twingap.prognosis.degradation_models import MODELS, CurveFit, CurveModel, fit_curve
from twingap.prognosis.degrade import Degradation, DegradeOptions, degrade
from twingap.prognosis.encoding import D_MODEL, positional_encoding, sequence_position, speed_position
from twingap.prognosis.estimate import Estimate, LifeOptions
from twingap.prognosis.feature_table import read_feature_table
from twingap.prognosis.follow import Followed, follow
from twingap.prognosis.health_indicator import Indicators, features_of, offline_indicators, online_indicators
from twingap.prognosis.healthy import healthy_mode, logarithmic_decrement_damping
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.outcomes import Outcome, prior_from, read_outcomes
from twingap.prognosis.prior import LogNormal, Prior
from twingap.prognosis.remaining_life import remaining_revolutions, remaining_time_s, revolutions_in, time_along
from twingap.prognosis.simulated_lives import LifeSimulator, SignalModel
from twingap.prognosis.speed_influence import (
    SpeedInfluence,
    fit_speed_influence,
    normalised_peak_to_peak,
    speed_constants,
)

__all__ = [
    "D_MODEL",
    "MODELS",
    "PRINTED_STRIDES",
    "Adaptation",
    "AdaptiveTwin",
    "Anomaly",
    "AnomalyRule",
    "CurveFit",
    "CurveModel",
    "DamageFit",
    "Degradation",
    "DegradeOptions",
    "Estimate",
    "Followed",
    "Indicators",
    "LifeArchitecture",
    "LifeOptions",
    "LifeSimulator",
    "LogNormal",
    "OnlineLife",
    "Outcome",
    "Prior",
    "SignalModel",
    "SpeedInfluence",
    "Trajectory",
    "adapt",
    "critical_length",
    "damage",
    "degrade",
    "detect_anomaly",
    "deviations",
    "end_row",
    "features_of",
    "fit_curve",
    "fit_damage",
    "fit_speed_influence",
    "follow",
    "healthy_mode",
    "logarithmic_decrement_damping",
    "metrics",
    "normalised_peak_to_peak",
    "offline_indicators",
    "online_indicators",
    "positional_encoding",
    "prior_from",
    "read_feature_table",
    "read_outcomes",
    "remaining_revolutions",
    "remaining_time_s",
    "revolutions_in",
    "sequence_position",
    "speed_constants",
    "speed_position",
    "time_along",
    "trajectories",
]
