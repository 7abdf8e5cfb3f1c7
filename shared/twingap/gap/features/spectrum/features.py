"""Features of the background of one record: shape of the spectrum, roughness, impulsive noise, another bearing, drifts.

smooth spectrum (smooth_shape), amplitudes (acquisition.amplitudes)
tones taken out (without_tones) --> envelope at 1x (roughness); whitened --> impulses (impulsive_noise)
envelopes of four bands (tones.envelope_lines) --> comb of another bearing (tones.foreign_bearing)
changes within the record (drifts), ripple of the spectrum (cepstrum)
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from twingap.gap.features.acquisition.amplitudes import measure_amplitudes
from twingap.gap.features.spectrum.cepstrum import measure_ripple
from twingap.gap.features.spectrum.drifts import measure_drifts
from twingap.gap.features.spectrum.impulsive_noise import measure_impulsive_noise
from twingap.gap.features.spectrum.roughness import measure_roughness
from twingap.gap.features.spectrum.smooth_shape import BANDS, measure_shape
from twingap.gap.features.tones.foreign_bearing import REGIONS, measure_foreign_bearing
from twingap.signal.record_transforms import RecordTransforms

NAMES: Final[tuple[str, ...]] = (
    *(f"band_{i:02d}" for i in range(BANDS)), "mode_fs", "mode_damping_log", "mode_over_white_log", "white_level",
    "rest_rms", "rest_low", "rest_low_slope", "rest_high", "rest_high_slope", "rest_bump", "rest_bump_fs",
    "rest_bump_hz_log", "rest_bump_width", "rest_dip", "rest_dip_fs", "edge_step", "edge_hz_log", "rms_log",
    "kurtosis_log", "skewness", "crest_log", "quantile_50", "quantile_90_50", "quantile_99_90", "quantile_999_99",
    "rough_1x", "rough_2x", "rough_depth", "rough_1x_full", "rough_ratio_log", "envelope_1x", "impulse_rate_log",
    "impulse_count_log", "impulse_level", "impulse_peak_log", "impulse_hz_log", "impulse_fs", "impulse_damping_log",
    "white_kurtosis_log", "foreign_score", *(f"foreign_score_{i}" for i in range(len(REGIONS))), "foreign_order",
    "foreign_excess", "foreign_depth", "foreign_fs", "segment_spread", "segment_slope", "segment_jump",
    "segment_mean_spread", "spectral_drift", "time_asymmetry", "half_wave_asymmetry", "low_skewness", "level_coupling",
    "echo_peak", "echo_lag_log", "modulation_free", "modulation_free_hz_log", "modulation_slow",
)  # fmt: skip
"""Keys of `measure`."""


def measure(record: RecordTransforms) -> dict[str, float]:
    """`NAMES` -> value of one record; NaN where a feature does not apply.

    Levels are log10 of amplitudes over the healthy RMS, excesses log10 of power over that of noise, frequencies parts
    of the sampling rate or log10 of Hz.
    """
    out = dict.fromkeys(NAMES, math.nan)
    if record.x.size < 256 or not np.isfinite(record.mean_square) or record.mean_square <= 0:
        return out
    smooth = record.smooth
    measure_shape(record, smooth, out)
    measure_amplitudes(record, out)
    measure_roughness(record, out)
    measure_impulsive_noise(record, smooth, out)
    measure_foreign_bearing(record, out)
    measure_drifts(record, out)
    measure_ripple(record, out)
    return {name: value if math.isfinite(value) else math.nan for name, value in out.items()}
