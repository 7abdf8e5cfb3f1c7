"""Signal tools: spectra, envelope, order tracking, spectral kurtosis, features, variational mode decomposition."""

from twingap.signal.vmd import Modes, vmd, vmd_hz

__all__ = ["Modes", "vmd", "vmd_hz"]
