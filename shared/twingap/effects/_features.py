"""Patterns of features that several effects share.

A pattern is matched against the name of a feature of the comparison: ``family.feature`` for those computed on records,
``family|feature`` for those computed on sets of records.
"""

from __future__ import annotations

from typing import Final

CLARITY_OF_IMPACTS: Final = ("impacts.evidence", "impacts.level", "impacts.snr")
LEVELS_OF_IMPACTS: Final = (*CLARITY_OF_IMPACTS, "impacts.phase_lock", "impacts.harmonic_*")
TIMING: Final = (
    *LEVELS_OF_IMPACTS, "impacts.smear_*", "impacts.wander_*", "impacts.timing_*", "impacts.jitter_*", "impacts.walk_*",
    "impacts.rate_log_ratio", "impacts.cycle_width_deg", "lines.shaft_lock", "lines.order_1_excess",
    "background.segment_spread", "background.spectral_drift", "lines.peaks_log", "impacts.scatter_sigma",
)  # fmt: skip
STRENGTH: Final = (
    *LEVELS_OF_IMPACTS, "impacts.scatter_*", "impacts.strength_*", "impacts.shaft_depth", "impacts.shaft_line_log",
    "impacts.cage_*", "impacts.zone_depth", "impacts.jitter_sigma", "impacts.walk_sigma", "impacts.wander_log",
    "impacts.timing_log_1", "background.envelope_1x", "background.kurtosis_log", "background.crest_log",
    "background.quantile_*", "background.impulse_count_log",
)  # fmt: skip
SHAPE: Final = (
    "shape|*", "path|*", "change|*", "impulse_response|*", "comb|*", "impulse_response.*", "background.band_*",
    "background.mode_*", "background.white_level", "background.rest_*", "background.edge_*", "background.rms_log",
    "background.time_asymmetry", "background.kurtosis_log", "background.rough_*", "background.envelope_1x",
    "impacts.level", "impacts.snr", "background.impulse_*", "background.foreign_score",
    "background.quantile_*", "pooled|envelope_*",
)  # fmt: skip
TONES: Final = (
    "lines.*", "pooled|*", "background.band_00", "background.band_01", "impacts.rate_log_ratio", "impacts.snr",
)  # fmt: skip
IMPULSES: Final = (
    "background.impulse_*", "background.white_kurtosis_log", "background.kurtosis_log", "background.crest_log",
    "background.quantile_*", "background.foreign_*", "background.rms_log", "background.rest_*", "background.band_*",
    "lines.comb_*", "background.segment_*", "converter.gap_*", "impacts.snr", "impacts.scatter_sigma", "shape|*",
    "impulse_response|*",
)  # fmt: skip
LEVEL: Final = (
    "background.rms_log", "background.white_level", "background.mode_over_white_log", "background.kurtosis_log",
    "background.crest_log", "background.quantile_*", *CLARITY_OF_IMPACTS, "background.band_*", "background.rest_rms",
    "background.impulse_peak_log", "lines.fault_low_excess", "impacts.harmonic_1", "background.rest_low",
    "impulse_response.*", "impulse_response|level", "trend|*",
)  # fmt: skip
