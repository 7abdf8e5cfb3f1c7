"""Results of an identification: estimates, fitted curves, notes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction of it that is done, 0 to 1."""


@dataclass(frozen=True)
class Estimate:
    """One identified parameter.

    Parameters
    ----------
    value : float
    interval : (float, float) or None
        At the wanted level; None where no method here has been shown to keep its level.
    """

    value: float
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class Fit:
    """One measured spectrum beside what the identified twin makes of it.

    Parameters
    ----------
    title : str
        Which records.
    f_hz : Array [bins]
    measured, fitted : Array [bins]
        One-sided PSD, `unit` squared per Hz.
    used : NDArray[bool] [bins]
        Bins that entered the fit.
    resonance_hz : float
        Marker.
    unit : str
        Of the samples.
    band : bool
        Whether the bins used are one band of frequencies, rather than all but some.
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
    """What a model's identification finds.

    Parameters
    ----------
    estimates : dict[str, Estimate]
        By parameter, dotted within tables.
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
        What was found, by parameter.
    fits : tuple[Fit, ...]
        Curves for figures.
    notes : tuple[str, ...]
        What could not be identified, and what was done instead.
    """

    spec: TwinSpec
    estimates: dict[str, Estimate]
    fits: tuple[Fit, ...]
    notes: tuple[str, ...]
