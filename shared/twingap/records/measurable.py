"""Check for samples of impossible magnitude, which indicate a file that was decoded wrongly."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError

LEAST: Final = 1e-30
MOST: Final = 1e30
"""Bounds of the peak-to-peak value of samples and of their size: fourth powers beyond them underflow or overflow."""


def refuse_unmeasurable(samples: NDArray[np.float64], where: str) -> None:
    """Refuse samples whose fourth powers would underflow or overflow. Constant samples pass.

    Parameters
    ----------
    samples : Array [samples]
    where : str
        Place that the message names.

    Raises
    ------
    TwingapError
    """
    spread, largest = float(np.ptp(samples)), float(np.abs(samples).max())
    if 0 < spread <= LEAST or largest >= MOST:
        raise TwingapError(
            f"samples reach {largest:.3g} and spread over {spread:.3g}, which no accelerometer measures", where=where,
            mend="check the unit and how the file was read",
        )  # fmt: skip
