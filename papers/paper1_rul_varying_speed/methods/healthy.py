"""Dominant mode of the structure from healthy records (eq. 8).

healthy records --spectra--> dominant peak --> resonance
                        \\--> free decay --logarithmic decrement, eq. 8--> damping ratio
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.identification import HealthyFit, equation_8, spectra
from twingap.records import RecordSet

Array = NDArray[np.float64]


def logarithmic_decrement_damping(x1: ArrayLike, x2: ArrayLike) -> Array:
    """zeta = delta / sqrt(4 pi^2 + delta^2), delta = ln|x1 / x2|: eq. 8 of paper 1.

    Parameters
    ----------
    x1, x2 : array_like [...]
        Maxima of a free decay, one period apart, not 0.

    Returns
    -------
    Array [...]
        Damping ratio; negative where x2 is the greater.
    """
    delta = np.log(np.abs(np.asarray(x1, float) / np.asarray(x2, float)))
    return np.asarray(delta / np.hypot(2 * np.pi, delta))


def healthy_mode(records: RecordSet, *, lowest_hz: float = 0.0) -> HealthyFit:
    """Resonance and damping of eq. 8 from healthy records, at whatever speeds they were taken.

    Parameters
    ----------
    records : RecordSet
        Healthy; see `identify.equation_8` for how the decrement is read off them, `identify.whittle` for the better
        estimate where one mode and white noise hold.
    lowest_hz : float
        The peak is sought above it.

    Returns
    -------
    HealthyFit

    Raises
    ------
    TwingapError
        When nothing stands out of the floor, or the peak does not ring.
    """
    return equation_8(spectra(records), lowest_hz=lowest_hz)
