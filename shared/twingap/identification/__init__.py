"""Parameters of twins from records, with intervals."""

from twingap.identification.identify import IDENTIFICATIONS, Identification, identify
from twingap.identification.resonance import HealthyFit, equation_8, whittle
from twingap.identification.result import Estimate, Fit, Identified, Outcome
from twingap.identification.spectra import Spectra, spectra

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
