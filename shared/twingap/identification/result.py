"""Results of an identification: estimates, fitted curves, notes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]

Progress = Callable[[str, float], None]
"""Called with the current step and the fraction done, 0 to 1."""


@dataclass(frozen=True)
class Estimate:
    """One identified parameter.

    Parameters
    ----------
    value : float
    interval : (float, float) or None
        Interval at the requested level; None where no reliable one is available.
    """

    value: float
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class Fit:
    """Measured spectrum and that of the identified twin.

    Parameters
    ----------
    title : str
        Description of the records.
    f_hz : Array [bins]
    measured, fitted : Array [bins]
        One-sided PSD, `unit` squared per Hz.
    used : NDArray[bool] [bins]
        Bins of the fit.
    resonance_hz : float
        Frequency to mark in figures.
    unit : str
        Unit of the samples.
    band : bool
        Whether the bins of the fit are one band of frequencies.
    """

    title: str
    f_hz: Array
    measured: Array
    fitted: Array
    used: NDArray[np.bool_]
    resonance_hz: float
    unit: str
    band: bool = False


@dataclass(frozen=True)
class Outcome:
    """Result of a model's identification.

    Parameters
    ----------
    estimates : dict[str, Estimate]
        Estimates by dotted parameter name.
    fits : tuple[Fit, ...]
    notes : tuple[str, ...]
        What could not be identified, and what was done instead.
    """

    estimates: dict[str, Estimate]
    fits: tuple[Fit, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Identified:
    """An identified twin.

    Parameters
    ----------
    spec : TwinSpec
        With values, intervals and provenance.
    estimates : dict[str, Estimate]
        Estimates by parameter.
    fits : tuple[Fit, ...]
        Curves for figures.
    notes : tuple[str, ...]
        What could not be identified, and what was done instead.
    """

    spec: TwinSpec
    estimates: dict[str, Estimate]
    fits: tuple[Fit, ...]
    notes: tuple[str, ...]
