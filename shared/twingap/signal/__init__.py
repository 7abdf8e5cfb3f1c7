"""Signal tools: spectra, envelope, order tracking, spectral kurtosis, features, variational mode decomposition.

Arrays have time last, `[..., samples]`; leading axes are batch axes.
"""

from twingap.signal.envelope import (
    Lines,
    analytic_signal,
    demodulate,
    envelope,
    impulsive_envelope_spectrum,
    lines_at,
    most_impulsive_band,
    squared_envelope_spectrum,
)
from twingap.signal.features import (
    PAPER2_FEATURES,
    SPECTRAL_KURTOSIS_FEATURES,
    TIME_FEATURES,
    FeatureTable,
    paper2_features,
    spectral_kurtosis_features,
    time_features,
)
from twingap.signal.kurtosis import Band, Kurtogram, fast_kurtogram, gaussian_sk_sd, spectral_kurtosis
from twingap.signal.orders import (
    order_spectrum,
    synchronous_average,
    to_angle,
    turns_from_speed,
    turns_from_tacho,
    without_average,
)
from twingap.signal.spectrum import (
    Spectrum,
    amplitude_spectrum,
    averaged_spectrum,
    nearest_bin,
    power_spectral_density,
)
from twingap.signal.tacho import TachoPulses, repaired_tacho
from twingap.signal.vmd import Modes, vmd, vmd_hz

__all__ = [
    "PAPER2_FEATURES",
    "SPECTRAL_KURTOSIS_FEATURES",
    "TIME_FEATURES",
    "Band",
    "FeatureTable",
    "Kurtogram",
    "Lines",
    "Modes",
    "Spectrum",
    "TachoPulses",
    "amplitude_spectrum",
    "analytic_signal",
    "averaged_spectrum",
    "demodulate",
    "envelope",
    "fast_kurtogram",
    "gaussian_sk_sd",
    "impulsive_envelope_spectrum",
    "lines_at",
    "most_impulsive_band",
    "nearest_bin",
    "order_spectrum",
    "paper2_features",
    "power_spectral_density",
    "repaired_tacho",
    "spectral_kurtosis",
    "spectral_kurtosis_features",
    "squared_envelope_spectrum",
    "synchronous_average",
    "time_features",
    "to_angle",
    "turns_from_speed",
    "turns_from_tacho",
    "vmd",
    "vmd_hz",
    "without_average",
]
