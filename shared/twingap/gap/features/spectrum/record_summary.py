"""What is kept of a record once its view is gone: enough for what is asked of many records together.

RecordView --smooth spectrum, whitened spectra, strikes, RMS--> Outline
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.impacts.impulse_response import Struck, struck_of
from twingap.gap.features.tones.whitened_spectra import Whitened, whitened
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordView

Array = NDArray[np.float64]


class Outline(NamedTuple):
    """Of one record.

    Parameters
    ----------
    condition : Condition
    frame : Frame
    fs_hz : float
    smooth : Array [view.SMOOTH_SEGMENTS]
        Power density, unit^2 / Hz.
    whitened : Whitened
        For lines of many records.
    struck : Struck or None
        Of a record with impacts.
    rms : float
        About the mean, in the unit of the records.
    """

    condition: Condition
    frame: Frame
    fs_hz: float
    smooth: Array
    whitened: Whitened
    struck: Struck | None
    rms: float


def outline_of(view: RecordView) -> Outline:
    """What is kept of one record."""
    struck, rms = struck_of(view), float(np.std(view.x))
    return Outline(view.condition, view.frame, view.fs_hz, view.smooth, whitened(view), struck, rms)
