"""Separation of the impacts of a defect from the background in a finished waveform.

waveforms of the healthy bearing --mean density--> background --subtracted, over frequency and the phase of a pass-->
impacts in a waveform with a defect --modulation of their power--> rate and phase of the passes

The waveform of a foreign simulator is the sum of impacts and noise. Effects on impacts would act on the noise as well:
a second impact would double it, stronger impacts would amplify it. Noise and impacts share their bands, but impacts
occupy only a part of each pass, so that a periodically time-varying filter separates them (the Wiener filter of
cyclostationary signals: Gardner 1993, doi:10.1109/26.212375). The filter has the square root of the Wiener gain:
impacts keep their power, which the least-squares gain would reduce.
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
"""Segment length, samples. A longer one resolves modes better and impacts within a pass worse."""
_HOP: Final = 16
_WINDOW: Final = np.hanning(_SEGMENT + 1)[:-1]
_GAIN: Final = 1.5
"""Sum of the squared window over its four places."""
_PHASES: Final = 12
_FEWEST_PASSES: Final = 4
_OFF: Final = 0.03
"""Largest relative error of the stated rate of passes: cages slip, and simulators differ in geometry."""
_PIECES_A_PASS: Final = 16
_FINER: Final = 8
"""Rates that are tried per resolvable rate. A larger number is more precise and slower."""
_LOUDEST: Final = 4.0
"""Upper bound of power, over its 90 % quantile. A larger value lets single strong impacts decide."""
_PLAIN: Final = 0.2
"""Modulation of the impacts' power over a pass from which their phase is known. A larger value rejects more."""


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
        """From healthy records of one sampling rate; None where none is long enough."""
        known = [_power(_frames(x)).mean(axis=1) for x in waveforms if x.size >= 4 * _SEGMENT]
        return cls(np.median(known, axis=0)) if known else None

    def impacts(self, x: Array, passes: Array) -> Array:
        """[samples] The part of a record with a defect that exceeds this background; all of it where it is too short.

        Parameters
        ----------
        x : Array [samples]
            At the rate of the healthy records.
        passes : Array [samples]
            Passes since the record's start at each sample, from the stated rate.
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


def amplified(x: Array, impacts: Array, gain: float, on_background: float = 1.0) -> Array:
    """[samples] A record with a defect whose impacts are `gain` times as strong, and its background `on_background`.

    Both parts were cut out of one waveform, so that they are in phase, and multiples of them would add up to too much
    or too little wherever they share a band. Powers of what is not related add: each short segment of the record is
    multiplied, at each frequency, by the factor by which its power changes.

    Parameters
    ----------
    x : Array [samples]
    impacts : Array [samples]
        Its impacts, from `Background.impacts`.
    gain, on_background : float
        Factors on amplitudes.
    """
    if gain == on_background or x.size < 4 * _SEGMENT:
        return np.asarray(gain * impacts + on_background * (x - impacts))
    frames, own = _frames(x), _frames(impacts)
    part = np.clip((own * frames.conj()).real / np.maximum(_power(frames), 1e-300), 0.0, 1.0) ** 2  # of the power
    return _built(frames * np.sqrt(on_background**2 * (1 - part) + gain**2 * part), x.size)


def _frames(x: Array) -> NDArray[np.complex128]:
    """[33, frames] Windowed segments every 16 samples, the first about sample -16."""
    padded = np.pad(x, (_SEGMENT - _HOP, _SEGMENT), mode="reflect")
    pieces = np.lib.stride_tricks.sliding_window_view(padded, _SEGMENT)[::_HOP]
    return np.asarray(scipy.fft.rfft(pieces * _WINDOW, axis=1).T)


def _built(frames: NDArray[np.complex128], size: int) -> Array:
    """[samples] Waveform from its segments, by overlap-add (four segments overlap)."""
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
        Passes since the record's start at each sample, from the stated rate.

    Returns
    -------
    (float, float) or None
        Rate over the stated one, and part of a pass. None where the impacts do not exceed the signal between them
        clearly, or are too few.
    """
    total = float(passes[-1])
    if total < _FEWEST_PASSES:
        return None
    step = max(int(impacts.size / (total * _PIECES_A_PASS)), 1)
    count = impacts.size // step
    power = (impacts[: count * step] ** 2).reshape(count, step).mean(axis=1)
    # A rare impulse must not decide: it counts as one impact.
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
