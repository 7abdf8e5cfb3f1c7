"""Lines of envelope spectra, and whether shaft, cage or fault explain them.

Envelope --> Lines (found once); frequencies --> on the shaft's, the cage's or the fault's lines?
"""

from __future__ import annotations

import math
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.tones.tones import SEARCH, Lines, lines_of
from twingap.records import Array
from twingap.signal.record_transforms import Envelope, RecordTransforms, once_a_record

_SPECTRA: WeakKeyDictionary[Envelope, dict[float, Lines]] = WeakKeyDictionary()
_FAULT_HARMONICS: Final = np.arange(1.0, 6.0)
"""Harmonics of the fault that its rate is searched with."""


def envelope_lines(envelope: Envelope, shaft_hz: float) -> Lines | None:
    """The lines of an envelope spectrum, up to thirty shaft orders beyond what fault combs need; found once."""
    if envelope.values.size < 128 or envelope.mean <= 0:
        return None
    known = _SPECTRA.setdefault(envelope, {})
    if shaft_hz not in known:
        last = int(min(80 * shaft_hz / envelope.df_hz, envelope.spectrum.size))
        known[shaft_hz] = Lines(envelope.spectrum[: max(last, 64)], envelope.df_hz, shaft_hz, None)
    return known[shaft_hz]


def explained(record: RecordTransforms, hz: Array, df_hz: float) -> NDArray[np.bool_]:
    """[frequencies] Whether shaft, cage, or the fault with its side lines explain envelope lines."""
    lines = lines_of(record)
    fault = math.nan if record.fault_order is None else fault_hz(record)
    loose = 0.0 if lines.locked else SEARCH / 2
    return _of_rotation(hz, lines.shaft_hz, record.bearing.ftf * lines.shaft_hz, fault, loose, 2.2 * df_hz)


def _of_rotation(hz: Array, shaft: float, cage: float, fault: float, loose: float, width: float) -> NDArray[np.bool_]:
    """[frequencies] Which lie on the shaft's first orders, the cage's, or the fault's with side lines (NaN: none)."""
    k = np.maximum(np.rint(hz / shaft), 1)
    own = (k <= 3) & (np.abs(hz - k * shaft) < width + loose * np.minimum(hz, 2 * shaft))
    k = np.maximum(np.rint(hz / cage), 1)
    own |= (k <= 4) & (np.abs(hz - k * cage) < width + 0.03 * hz)
    lines, sides = fault * np.arange(40)[:, None, None], np.array([0.0, shaft, 2 * shaft, cage])[:, None]
    off = np.abs(np.abs(hz - lines) - sides)
    return np.asarray(own | (off < width + 0.001 * lines + 0.03 * sides).any(axis=(0, 1)))


@once_a_record
def fault_hz(record: RecordTransforms) -> float:
    """Rate of the fault, from its comb in the raw spectrum or in the envelope; computed once."""
    lines = lines_of(record)
    assert record.fault_order is not None
    stated = record.fault_order * record.shaft_hz
    ratio = lines.fault_comb[0]
    if math.isfinite(ratio):
        return stated * ratio
    env = envelope_lines(record.envelope, record.shaft_hz)
    if env is None:
        return stated
    ratios = np.linspace(1 - SEARCH - 0.02, 1 + SEARCH + 0.02, 301)
    places = np.rint(ratios[:, None] * stated * _FAULT_HARMONICS / env.df_hz).astype(int)
    inside = places < env.tones.size - 1
    logs = np.where(inside, np.log10(np.maximum(env.excess[np.minimum(places, env.tones.size - 1)], 1e-2)), 0.0)
    return float(stated * ratios[int(np.argmax(np.clip(logs, 0, 3).sum(axis=1)))])
