"""Lines of envelope spectra, and whether shaft, cage or fault explain them.

Envelope --> Lines (found once); frequencies --> on the shaft's, the cage's or the fault's lines?
"""

from __future__ import annotations

import math
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit
from twingap.gap.features.tones.tones import SEARCH, Lines, lines_of
from twingap.signal.record_transforms import Envelope, RecordTransforms

Array = NDArray[np.float64]

_SPECTRA: WeakKeyDictionary[Envelope, dict[float, Lines]] = WeakKeyDictionary()
_FAULT_HARMONICS: Final = np.arange(1.0, 6.0)
"""Harmonics of the fault that its rate is searched with."""
_FAULT_HZ: WeakKeyDictionary[RecordTransforms, float] = WeakKeyDictionary()


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
    out = np.zeros(hz.size, bool)
    _mark_rotation(hz, lines.shaft_hz, record.bearing.ftf * lines.shaft_hz, fault, loose, 2.2 * df_hz, out)
    return out


@njit(error_model="numpy")
def _mark_rotation(hz, shaft, cage, fault, loose, width, out):  # type: ignore[no-untyped-def]  # pragma: no cover
    """[frequencies] Which lie on the shaft's first orders, the cage's, or the fault's with side lines (NaN: none)."""
    for i in range(hz.size):
        k = round(hz[i] / shaft)
        k = 1 if k < 1 else k
        near = hz[i] if hz[i] < 2 * shaft else 2 * shaft
        own = k <= 3 and abs(hz[i] - k * shaft) < width + loose * near
        k = round(hz[i] / cage)
        k = 1 if k < 1 else k
        own |= k <= 4 and abs(hz[i] - k * cage) < width + 0.03 * hz[i]
        for k in range(40):
            for side in (0.0, shaft, 2 * shaft, cage):
                off = abs(abs(hz[i] - k * fault) - side)
                own |= off < width + 0.001 * k * fault + 0.03 * side  # never true of NaN
        out[i] = own


def fault_hz(record: RecordTransforms) -> float:
    """Rate of the fault, from its comb in the raw spectrum or in the envelope; computed once."""
    found = _FAULT_HZ.get(record)
    if found is None:
        found = _FAULT_HZ[record] = _search_fault(record)
    return found


def _search_fault(record: RecordTransforms) -> float:
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
