"""Parameters of twins from records, with intervals."""

from twingap.identify.identify import IDENTIFICATIONS, Identification, identify
from twingap.identify.resonance import HealthyFit, equation_8, whittle
from twingap.identify.result import Estimate, Fit, Identified, Outcome
from twingap.identify.spectra import Spectra, spectra

__all__ = [
    "IDENTIFICATIONS",
    "Estimate",
    "Fit",
    "HealthyFit",
    "Identification",
    "Identified",
    "Outcome",
    "Spectra",
    "equation_8",
    "identify",
    "spectra",
    "whittle",
]
