"""Samples that no accelerometer measures: files whose bytes were read wrongly."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError

LEAST: Final = 1e-30
MOST: Final = 1e30
"""Of what samples spread over: fourth powers beyond would vanish or overflow."""


def refuse_unmeasurable(samples: NDArray[np.float64], where: str) -> None:
    """Refuse samples whose fourth powers would not stay numbers. Equal samples pass.

    Parameters
    ----------
    samples : Array [samples]
    where : str
        For the message.

    Raises
    ------
    TwingapError
    """
    spread = float(np.ptp(samples))
    if spread > 0 and not LEAST < spread < MOST:
        raise TwingapError(
            f"samples spread over {spread:.3g}, which no accelerometer measures", where=where,
            mend="check the unit and how the file was read",
        )  # fmt: skip
