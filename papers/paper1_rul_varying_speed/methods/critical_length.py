"""Record length that holds at least one impact of the rarest fault (eq. 16).

bearing, lowest speed --> ball spin frequency --eq. 16--> samples
"""

from __future__ import annotations

import math

from twingap.bearing import Bearing
from twingap.errors import TwingapError


def critical_length(bearing: Bearing, lowest_speed_rpm: float, fs_hz: float, impacts: int = 1) -> int:
    """L_c = F_s / BSF, eq. 16 of paper 1, for one impact of a ball defect or several.

    Raises `TwingapError` when the speed, the rate or the number is not positive.

    Parameters
    ----------
    lowest_speed_rpm : float
        The lowest at which the machine runs: strokes are rarest there.
    impacts : int
        To be covered.

    Returns
    -------
    int
        Samples, rounded up.

    Notes
    -----
    A ball meets both races in one spin, but the paper counts one impact, on one race. Its own case, a 6205 at
    1000 rpm and 50 kHz, needs 25,459 samples for 20 impacts with the geometry of the SKF 6205; its 25,000 ("at least
    20 impacts") hold 19.6.
    """
    if not (lowest_speed_rpm > 0 and fs_hz > 0 and impacts > 0):
        raise TwingapError(
            f"{lowest_speed_rpm:g} rpm, {fs_hz:g} Hz, {impacts} impacts: all must be above 0", where="critical length"
        )
    return math.ceil(impacts * fs_hz / (bearing.bsf * lowest_speed_rpm / 60))
