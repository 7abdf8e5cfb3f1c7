"""Health indicators, degradation models and remaining life along a run.

peak to peak, speed --speed_influence--> normalised --anomaly--> alarm
rows of a run, one by one --OnlineLife.update, Prior of other runs--> Estimate; a complete run --follow--> Followed
features of a run --degrade--> Degradation: indicator, fitted curves, forecasts

A run is a record set with times in `run_records` (`follow`), and a table of features in `health_indicator`
(`degrade`). The names `follow` and `degrade` of this package are functions.
"""

from twingap.prognosis.anomaly import Anomaly, AnomalyRule, detect_anomaly, deviations
from twingap.prognosis.degradation_models import MODELS, CurveFit, CurveModel, fit_curve
from twingap.prognosis.degrade import Degradation, DegradeOptions, degrade
from twingap.prognosis.estimate import Estimate, LifeOptions
from twingap.prognosis.feature_table import read_feature_table
from twingap.prognosis.follow import Followed, follow
from twingap.prognosis.health_indicator import Indicators, features_of, offline_indicators, online_indicators
from twingap.prognosis.life_law import LogNormal, Mixture
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.outcomes import Outcome, prior_from, read_outcomes
from twingap.prognosis.prior import Prior
from twingap.prognosis.speed_influence import (
    SpeedInfluence,
    fit_speed_influence,
    normalised_peak_to_peak,
    speed_constants,
)

__all__ = [
    "MODELS",
    "Anomaly",
    "AnomalyRule",
    "CurveFit",
    "CurveModel",
    "Degradation",
    "DegradeOptions",
    "Estimate",
    "Followed",
    "Indicators",
    "LifeOptions",
    "LogNormal",
    "Mixture",
    "OnlineLife",
    "Outcome",
    "Prior",
    "SpeedInfluence",
    "degrade",
    "detect_anomaly",
    "deviations",
    "features_of",
    "fit_curve",
    "fit_speed_influence",
    "follow",
    "normalised_peak_to_peak",
    "offline_indicators",
    "online_indicators",
    "prior_from",
    "read_feature_table",
    "read_outcomes",
    "speed_constants",
]
