"""Impacts in a finished waveform: the response to one, the times and strengths of all, and the force between them.

waveforms with defects --strongest sample of each pass--> stretches, aligned --mean--> response to an impact
waveform --matched filter with the response, one maximum per pass--> times, amplitudes --+--> ImpactTrain
         --spectrum of the rest over that of the response------------> force ------------+

A path acts on impacts and force. What it adds in a band in which the waveform holds noise of the chain alone cannot be
made by a filter: that would amplify the noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.signal import fftconvolve, find_peaks, welch

from twingap.effects.draft import Draft

Array = NDArray[np.float64]

BEFORE: Final = 16
"""Samples of a response before its strongest one."""
_LONGEST: Final = 512
"""Largest number of samples of a response."""
_OF_PASS: Final = 0.8
"""Largest length of a response, as a part of a pass: later samples hold the next impact."""
_APART: Final = 0.55
"""Smallest distance of two impacts, as a part of a pass."""
_STRONG: Final = 0.5
"""Amplitude over that of strong ones (90 % quantile) from which an impact takes part in the mean response."""
_WEAK: Final = 0.12
"""The same from which it is an impact at all. A smaller value takes noise for weak impacts."""
_ABOVE: Final = 3.8
"""Median strong impact, in standard deviations of the waveform (from its median magnitude), from which these are
impacts. The largest sample of each pass of Gaussian noise is about three."""
_FEWEST: Final = 8
"""Smallest number of strong impacts in all waveforms together."""
_ALIGNMENTS: Final = 3
_AWAY: Final = 10
"""Largest number of samples by which a stretch is moved when it is aligned with the mean of all."""
_STANDS_OUT: Final = 3.0
"""RMS of the mean response's first samples, over its standard error, from which impacts are known."""
_FINER: Final = 8
"""Positions between two samples at which an impact may lie."""
_IN_BAND: Final = 0.1
"""Power of the response over its maximum from which a frequency tells of the force."""
_FORCED: Final = 0.2
"""Quantile, over these frequencies, of the rest's spectrum over the response's: noise of other origin only adds."""
_SEGMENT: Final = 256
"""Samples of a segment of that spectrum."""
_FINE: Final = 4096
"""Length of the transform that places the response's strongest mode."""
_KEPT: Final = 96
"""Largest number of waveforms whose impacts are kept."""


@dataclass(frozen=True)
class ImpactTrain:
    """Impacts and broadband force of a finished waveform.

    Parameters
    ----------
    times_s : Array [impacts]
        When each begins; empty for a healthy bearing.
    amplitudes : Array [impacts]
        Largest response to each, in the unit of the waveform.
    force_rms : float
        Standard deviation of a force, independent from sample to sample, that the same response turns into the
        waveform's own noise.
    known_force : Array [samples]
        The part of that force that the waveform shows, in bands where its noise has passed the response.
    unknown : Array [samples // 2 + 1]
        Amplitude of the other part at the frequencies of a real transform, over that of the whole force.
    through : Array [samples // 2 + 1]
        Response from the force to the waveform, at these frequencies.
    impacts : Array [samples]
        Sum of the responses to the impacts.
    """

    times_s: Array
    amplitudes: Array
    force_rms: float
    known_force: Array
    unknown: Array
    through: NDArray[np.complex128]
    impacts: Array

    def force(self, rng: np.random.Generator) -> Array:
        """[samples] The force: what is known of it, and independent noise elsewhere."""
        n = self.known_force.size
        noise = scipy.fft.rfft(self.force_rms * rng.standard_normal(n))
        return np.asarray(self.known_force + scipy.fft.irfft(noise * self.unknown, n))

    def forced(self, rng: np.random.Generator) -> Array:
        """[samples] Response to the force."""
        return np.asarray(scipy.fft.irfft(scipy.fft.rfft(self.force(rng)) * self.through, self.known_force.size))


def response_of(waveforms: Sequence[Array], passes: Sequence[float]) -> Array | None:
    """Response to one impact, of unit maximum at sample `BEFORE`; None where impacts do not stand out.

    Parameters
    ----------
    waveforms : sequence of Array [samples]
        Of bearings with defects, at one sampling rate.
    passes : sequence of float
        Samples from one impact to the next in each.
    """
    length = int(min([_LONGEST, *(_OF_PASS * one for one in passes)]))
    if length < 2 * BEFORE:
        return None
    stretches: list[Array] = []
    for x, spacing in zip(waveforms, passes, strict=True):
        size = np.abs(x - x.mean())
        places, _ = find_peaks(size, distance=max(int(_APART * spacing), 1))
        places = places[(places > BEFORE + _AWAY) & (places < x.size - length - _AWAY)]
        if not places.size:
            continue
        strong = places[size[places] > _STRONG * np.quantile(size[places], 0.9)]
        if np.median(size[strong]) < _ABOVE * 1.4826 * np.median(size):
            continue
        own = [x[p - BEFORE - _AWAY : p - BEFORE + length + _AWAY] / size[p] for p in strong]
        stretches += [one * np.sign(one[BEFORE + _AWAY]) for one in own]
    if len(stretches) < _FEWEST:
        return None
    all_ = np.array(stretches)
    mean = all_[:, _AWAY : _AWAY + length].mean(axis=0)
    for _ in range(_ALIGNMENTS):
        fits = np.array([all_[:, k : k + length] @ mean for k in range(2 * _AWAY + 1)])
        best = np.abs(fits).argmax(axis=0)
        rows = np.arange(len(all_))
        signs = np.sign(fits[best, rows])
        aligned = np.stack([one[k : k + length] for one, k in zip(all_, best, strict=True)]) * signs[:, None]
        mean = aligned.mean(axis=0)
    near = slice(BEFORE + 3, BEFORE + 3 + 2 * BEFORE)  # the strongest sample stands out of noise too
    differs = aligned.std(axis=0) / math.sqrt(len(aligned))
    if np.sqrt((mean[near] ** 2).mean()) < _STANDS_OUT * np.sqrt((differs[near] ** 2).mean()):
        return None
    edge = length // 4
    mean = mean.copy()
    mean[-edge:] *= 0.5 + 0.5 * np.cos(np.pi * np.arange(edge) / edge)
    mean[:4] *= np.arange(4) / 4
    top = int(np.abs(mean).argmax())
    mean = np.roll(mean, BEFORE - top) if top < 2 * BEFORE + _AWAY else mean
    return np.asarray(mean / mean[int(np.abs(mean).argmax())])


def train_of(draft: Draft) -> ImpactTrain | None:
    """Impacts and force of a draft's finished waveform; None where its simulator's response is not known."""
    response = draft.impact_response()
    if response is None or draft.x.size < 4 * response.size:
        return None
    c = draft.condition
    spacing = c.fs_hz / (draft.fault_order * draft.shaft_hz) if draft.faulty else 0.0
    return _train(draft.x.tobytes(), response.tobytes(), spacing, c.fs_hz)


@lru_cache(maxsize=_KEPT)
def _train(waveform: bytes, response: bytes, spacing: float, fs_hz: float) -> ImpactTrain:
    x, h = np.frombuffer(waveform), np.frombuffer(response)
    places, amplitudes = _impacts(x - x.mean(), h, spacing) if spacing else (np.empty(0), np.empty(0))
    impacts = responses(places, amplitudes, h, x.size)
    rest = x - x.mean() - impacts
    begin = BEFORE - _rise(h)
    f = scipy.fft.rfftfreq(x.size)
    through = scipy.fft.rfft(h, x.size) * np.exp(2j * np.pi * f * begin)
    power = np.abs(through) ** 2
    welched = welch(rest, nperseg=_SEGMENT, return_onesided=False, detrend="constant", average="median")[1]
    density = np.exp(
        np.interp(f, np.arange(_SEGMENT // 2 + 1) / _SEGMENT, np.log(welched[: _SEGMENT // 2 + 1] + 1e-300))
    )
    inside = power > _IN_BAND * power.max()
    variance = float(np.quantile(density[inside] / power[inside], _FORCED))
    # Wiener filter: in bands of other noise the waveform does not show the force.
    known = np.clip(variance * power / density, 0.0, 1.0)
    shown = scipy.fft.irfft(known * scipy.fft.rfft(rest) / (through + 1e-12), x.size)
    times = (places - BEFORE + begin) / fs_hz
    return ImpactTrain(times, amplitudes, math.sqrt(variance), shown, np.sqrt(1 - known), through, impacts)


def _rise(h: Array) -> float:
    """Samples from an impact to the maximum of the response of its strongest mode."""
    power = np.abs(scipy.fft.rfft(h, _FINE)) ** 2
    top = max(int(power.argmax()), 1)
    half = np.flatnonzero(power < 0.5 * power[top])
    above, below = half[half > top], half[half < top]
    ends = (int(below[-1]) if below.size else 0), (int(above[0]) if above.size else power.size)
    damping = min((ends[1] - ends[0]) / (2 * top), 0.5)
    return (0.5 * math.pi - damping) / (2 * math.pi * top / _FINE)


def _impacts(x: Array, h: Array, spacing: float) -> tuple[Array, Array]:
    """Places, in samples, and amplitudes of the strongest sample of each impact."""
    fit = fftconvolve(x, h[::-1], mode="full")[h.size - 1 - BEFORE : h.size - 1 - BEFORE + x.size] / float(h @ h)
    size = np.abs(fit)
    places, _ = find_peaks(size, distance=max(int(_APART * spacing), 1))
    if not places.size:
        return np.empty(0), np.empty(0)
    places = places[size[places] > _WEAK * np.quantile(size[places], 0.9)]
    places = places[(places > 0) & (places < x.size - 1)]
    low, middle, high = size[places - 1], size[places], size[places + 1]
    bend = np.minimum(low - 2 * middle + high, -1e-300)
    shift = np.clip(0.5 * (low - high) / bend, -0.5, 0.5)
    return places + shift, (middle - 0.25 * (low - high) * shift) * np.sign(fit[places])


def responses(places: Array, amplitudes: Array, h: Array, size: int) -> Array:
    """[samples] Responses `h` whose strongest sample is at these places, in samples, with these amplitudes."""
    finer = scipy.fft.irfft(scipy.fft.rfft(np.pad(h, (0, h.size))), 2 * h.size * _FINER) * _FINER
    out = np.zeros(size + 2 * h.size)
    for place, amplitude in zip(places, amplitudes, strict=True):
        whole = math.floor(place)
        late = round((place - whole) * _FINER)
        stretch = np.roll(finer, late)[: h.size * _FINER : _FINER]
        begin = whole - BEFORE + h.size
        if not 0 <= begin < size + h.size:
            continue
        out[begin : begin + h.size] += amplitude * stretch
    return out[h.size : h.size + size]
