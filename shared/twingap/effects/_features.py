"""Patterns of features that several effects share.

A pattern is matched against the name of a feature of the comparison: ``family.feature`` for those computed on records,
``family|feature`` for those of the whole set.
"""

from __future__ import annotations

from typing import Final

LEVELS_OF_IMPACTS: Final = ("events.strike_*", "events.phase_lock", "events.harmonic_*")
TIMING: Final = (
    *LEVELS_OF_IMPACTS, "events.smear_*", "events.wander_*", "events.timing_*", "events.jitter_*", "events.walk_*",
    "events.rate_log_ratio", "events.cycle_width_deg", "lines.shaft_lock", "lines.order_1_excess",
    "background.segment_spread", "background.spectral_drift", "lines.peaks_log", "events.scatter_sigma",
)  # fmt: skip
STRENGTH: Final = (
    *LEVELS_OF_IMPACTS, "events.scatter_*", "events.strength_*", "events.shaft_depth", "events.shaft_line_log",
    "events.cage_*", "events.zone_depth", "events.jitter_sigma", "events.walk_sigma", "events.wander_log",
    "events.timing_log_1", "background.envelope_1x", "background.kurtosis_log", "background.crest_log",
    "background.quantile_*", "background.knock_count_log",
)  # fmt: skip
SHAPE: Final = (
    "shape|*", "path|*", "change|*", "answer|*", "comb|*", "answer.*", "background.band_*", "background.mode_*",
    "background.white_level", "background.rest_*", "background.edge_*", "background.rms_log",
    "background.time_asymmetry", "background.kurtosis_log", "background.rough_*", "background.envelope_1x",
    "events.strike_level", "events.strike_snr", "background.knock_*", "background.foreign_score",
    "background.quantile_*", "pooled|envelope_*",
)  # fmt: skip
TONES: Final = (
    "lines.*", "pooled|*", "background.band_00", "background.band_01", "events.rate_log_ratio", "events.strike_snr",
)  # fmt: skip
IMPULSES: Final = (
    "background.knock_*", "background.white_kurtosis_log", "background.kurtosis_log", "background.crest_log",
    "background.quantile_*", "background.foreign_*", "background.rms_log", "background.rest_*", "background.band_*",
    "lines.comb_*", "background.segment_*", "converter.gap_*", "events.strike_snr", "events.scatter_sigma", "shape|*",
    "answer|*",
)  # fmt: skip
LEVEL: Final = (
    "background.rms_log", "background.white_level", "background.mode_over_white_log", "background.kurtosis_log",
    "background.crest_log", "background.quantile_*", "events.strike_*", "background.band_*", "background.rest_rms",
    "background.knock_peak_log", "lines.fault_low_excess", "events.harmonic_1", "background.rest_low", "answer.*",
    "answer|level", "trend|*",
)  # fmt: skip
