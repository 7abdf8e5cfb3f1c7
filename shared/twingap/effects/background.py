"""Impacts of a defect apart from the background, in a finished waveform.

waveforms of the healthy bearing --mean density--> background --subtracted, over frequency and the phase of a pass-->
impacts in a waveform with a defect --swing of their power--> when they come

A foreign simulator hands over impacts and noise in one. Effects that act on impacts would act on its noise as well: a
second impact would double it, impacts twice as strong make all of the record louder. Noise and impacts share their
bands, but impacts are there for a part of each pass alone, which a filter that runs with the passes can separate (as
Wiener's for cyclostationary signals: Gardner 1993, doi:10.1109/26.212375). It passes the square root of what Wiener's
would: impacts keep their power, where the least error would leave them weaker than they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SEGMENT: Final = 64
"""Samples: short beside a pass, long enough to tell a mode from what is beside it."""
_HOP: Final = 16
_WINDOW: Final = np.hanning(_SEGMENT + 1)[:-1]
_GAIN: Final = 1.5
"""Sum of the squared window over its four places."""
_PHASES: Final = 12
_FEWEST_PASSES: Final = 4
_OFF: Final = 0.03
"""Part by which the rate of passes may lie off its stated one: cages slip, and foreign simulators have geometries."""
_PIECES_A_PASS: Final = 16
_FINER: Final = 8
"""Places at which rates are tried, over those that the length of a record tells apart."""
_LOUDEST: Final = 4.0
"""Power over what one piece in ten exceeds, beyond which it counts no more."""
_PLAIN: Final = 0.2
"""Swing of the impacts' power over a pass, over its mean, from which it shows when they come."""


@dataclass(frozen=True)
class Background:
    """Vibration of a bearing without a defect.

    Parameters
    ----------
    density : Array [33]
        Mean power in windowed segments of 64 samples, squared units of the records.
    """

    density: Array

    @classmethod
    def of(cls, waveforms: Sequence[Array]) -> Background | None:
        """Of healthy records, all at one rate; None where none is long enough."""
        known = [_power(_frames(x)).mean(axis=1) for x in waveforms if x.size >= 4 * _SEGMENT]
        return cls(np.median(known, axis=0)) if known else None

    def impacts(self, x: Array, passes: Array) -> Array:
        """[samples] What of a record with a defect is more than this; all of it where it is too short to say.

        Parameters
        ----------
        x : Array [samples]
            At the rate of the healthy records.
        passes : Array [samples]
            How many passes lie behind each sample, from the stated rate.
        """
        if x.size < 4 * _SEGMENT:
            return x
        frames = _frames(x)
        power = _power(frames)
        found = _built(frames * self._passed(power.mean(axis=1, keepdims=True)), x.size)
        when = passes_of(found, passes)
        if when is None:
            return found
        rate, begin = when
        middle = np.clip((np.arange(frames.shape[1]) - 1) * _HOP, 0, x.size - 1)
        phase = np.floor(((passes[middle] * rate - begin) % 1.0) * _PHASES).astype(int) % _PHASES
        of_phase = (phase == np.arange(_PHASES)[:, None]).astype(float)
        usual = power @ of_phase.T / np.maximum(of_phase.sum(axis=1), 1)
        return _built(frames * self._passed(usual)[:, phase], x.size)

    def _passed(self, power: Array) -> Array:
        return np.sqrt(np.clip(1 - self.density[:, None] / np.maximum(power, 1e-300), 0.0, 1.0))


def _frames(x: Array) -> NDArray[np.complex128]:
    """[33, frames] Windowed segments every 16 samples, the first about sample -16."""
    padded = np.pad(x, (_SEGMENT - _HOP, _SEGMENT), mode="reflect")
    pieces = np.lib.stride_tricks.sliding_window_view(padded, _SEGMENT)[::_HOP]
    return np.asarray(scipy.fft.rfft(pieces * _WINDOW, axis=1).T)


def _built(frames: NDArray[np.complex128], size: int) -> Array:
    """[samples] The waveform of which these are the segments: they overlap four times, and are added up."""
    pieces = scipy.fft.irfft(frames.T, _SEGMENT, axis=1) * _WINDOW
    out = np.zeros((pieces.shape[0] + _SEGMENT // _HOP - 1, _HOP))
    for part in range(_SEGMENT // _HOP):
        out[part : part + pieces.shape[0]] += pieces[:, part * _HOP : (part + 1) * _HOP]
    return np.asarray(out.ravel()[_SEGMENT - _HOP : _SEGMENT - _HOP + size] / _GAIN)


def _power(frames: NDArray[np.complex128]) -> Array:
    return np.asarray(frames.real**2 + frames.imag**2)


def passes_of(impacts: Array, passes: Array) -> tuple[float, float] | None:
    """Rate of the passes in a waveform of impacts, and the part of a pass after which their energy is centred.

    Parameters
    ----------
    impacts : Array [samples]
    passes : Array [samples]
        How many passes lie behind each sample, from their stated rate.

    Returns
    -------
    (float, float) or None
        The rate over the stated one, and a part of a pass. None where the impacts do not stand out of what is between
        them, or are too few.
    """
    total = float(passes[-1])
    if total < _FEWEST_PASSES:
        return None
    step = max(int(impacts.size / (total * _PIECES_A_PASS)), 1)
    count = impacts.size // step
    power = (impacts[: count * step] ** 2).reshape(count, step).mean(axis=1)
    # Nothing rare decides: an impulse among the impacts counts as one of them.
    power = np.minimum(power, _LOUDEST * float(np.quantile(power, 0.9)))
    even = np.arange(0.0, total, 1 / _PIECES_A_PASS)
    power = np.interp(even, passes[: count * step].reshape(count, step).mean(axis=1), power)
    spectrum = scipy.fft.rfft(power, scipy.fft.next_fast_len(_FINER * power.size, real=True)) / power.size
    rate = np.arange(spectrum.size) * _PIECES_A_PASS / scipy.fft.next_fast_len(_FINER * power.size, real=True)
    near = np.flatnonzero(np.abs(rate - 1) <= _OFF + 1 / total)
    best = near[np.argmax(np.abs(spectrum[near]))]
    if abs(spectrum[best]) <= _PLAIN * float(power.mean()) or best in (near[0], near[-1]):
        return None
    return float(rate[best]), float(-np.angle(spectrum[best]) / (2 * np.pi) % 1.0)
