"""Summary of a record: the spectra and levels that measurements over many records need; samples are not kept.

RecordTransforms --smooth spectrum, whitened spectra, spectrum of impacts, RMS, extremes--> RecordSummary
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from twingap.gap.features.impacts.impulse_response import ImpactSpectrum, impact_spectrum
from twingap.gap.features.tones.whitened_spectra import Whitened, whiten
from twingap.records import Array, Condition
from twingap.signal.rails import Extreme, extremes
from twingap.signal.record_transforms import SMOOTH_SEGMENTS, Frame, RecordTransforms, band_medians

_STRONG: Final = 3.5
"""ln of a line's power over its floor from which it and its skirts are left out. A smaller value leaves out parts of
sharp modes."""
_SKIRT: Final = 8
"""Bins on either side into which strong lines leak. A larger value leaves out more of what lies between lines."""


class RecordSummary(NamedTuple):
    """Summary of one record.

    `smooth` [record_transforms.SMOOTH_SEGMENTS] is a power density, unit^2 / Hz; `between_log` [as many] is ln of the
    level between lines (Hann), unit^2, into which strong lines do not leak; `whitened` is for lines in means over
    records; `rms` is about the mean, in the unit of the records; `extremes` are the highest and the lowest level.
    """

    condition: Condition
    frame: Frame
    fs_hz: float
    smooth: Array
    between_log: Array
    whitened: Whitened
    impact_spectrum: ImpactSpectrum | None
    rms: float
    extremes: tuple[Extreme, Extreme]


def log_bands(record: RecordSummary, bands: int) -> Array:
    """[bands] Mean ln of the smooth power density, over scale^2 and times the sampling rate, in equal bands."""
    unit = record.fs_hz / max(record.frame.scale, 1e-300) ** 2
    return np.asarray(np.log(np.maximum(record.smooth * unit, 1e-30)).reshape(bands, -1).mean(axis=1))


def summarise(record: RecordTransforms) -> RecordSummary:
    """Summary of one record."""
    white = whiten(record)
    return RecordSummary(
        record.condition, record.frame, record.fs_hz, record.smooth, _between_lines(record, white), white,
        impact_spectrum(record), float(np.std(record.x)), extremes(record.x),
    )  # fmt: skip


def _between_lines(record: RecordTransforms, white: Whitened) -> Array:
    """[SMOOTH_SEGMENTS] ln of the level between lines; that of the bands beside it where strong lines fill a band."""
    logs = np.log(np.maximum(band_medians(record.tones[1:], SMOOTH_SEGMENTS), 1e-300))
    line = maximum_filter1d(white.logs > _STRONG, 2 * _SKIRT + 1)
    clear = np.flatnonzero(band_medians(line[1:].astype(float), SMOOTH_SEGMENTS) < 0.5)
    return np.interp(np.arange(logs.size), clear, logs[clear]) if clear.size else logs
