"""Summary of a record: the spectra and levels that measurements over many records need; samples are not kept.

RecordTransforms --smooth spectrum, whitened spectra, spectrum of impacts, RMS--> RecordSummary
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twingap.gap.features.impacts.impulse_response import ImpactSpectrum, impact_spectrum
from twingap.gap.features.tones.whitened_spectra import Whitened, whiten
from twingap.records import Array, Condition
from twingap.signal.record_transforms import Frame, RecordTransforms


class RecordSummary(NamedTuple):
    """Summary of one record.

    `smooth` [record_transforms.SMOOTH_SEGMENTS] is a power density, unit^2 / Hz; `whitened` is for lines in means over
    records; `rms` is about the mean, in the unit of the records.
    """

    condition: Condition
    frame: Frame
    fs_hz: float
    smooth: Array
    whitened: Whitened
    impact_spectrum: ImpactSpectrum | None
    rms: float


def log_bands(record: RecordSummary, bands: int) -> Array:
    """[bands] Mean ln of the smooth power density, over scale^2 and times the sampling rate, in equal bands."""
    unit = record.fs_hz / max(record.frame.scale, 1e-300) ** 2
    return np.asarray(np.log(np.maximum(record.smooth * unit, 1e-30)).reshape(bands, -1).mean(axis=1))


def summarise(record: RecordTransforms) -> RecordSummary:
    """Summary of one record."""
    spectrum, rms = impact_spectrum(record), float(np.std(record.x))
    return RecordSummary(record.condition, record.frame, record.fs_hz, record.smooth, whiten(record), spectrum, rms)
