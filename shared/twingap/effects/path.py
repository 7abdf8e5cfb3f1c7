"""Effects on the path from the bearing to the sensor: structural modes and low-pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.registry import register
from twingap.effects.ringing import Mode

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class SecondResonance(Effect):
    """One more structural mode, beside the first: a peak that stays at its frequency whatever the speed.

    Impacts, rollers' contacts and broadband forces pass through both modes in parallel. Where a sensor sits elsewhere
    than the force acts, a mode may move it the other way: then the two cancel on other sides of their peaks. A finished
    waveform has passed a path already: what it holds around the frequency is raised by up to 1 + gain.
    """

    stage: ClassVar[Stage] = Stage.PATH
    references: ClassVar[tuple[str, ...]] = (
        "Randall & Antoni 2011, Rolling element bearing diagnostics - a tutorial, doi:10.1016/j.ymssp.2010.07.017",
    )
    frequency_hz: float = parameter(
        1600.0, unit="Hz", plausible=(300.0, 20000.0), allowed=(1.0, 1e7), log=True, doc="natural frequency"
    )
    damping_ratio: float = parameter(
        0.04, unit="", plausible=(0.01, 0.2), allowed=(1e-4, 0.99), log=True, doc="damping ratio zeta"
    )
    gain: float = parameter(
        0.6, unit="", plausible=(0.1, 5.0), log=True, doc="its response to an impact over that of the first mode"
    )
    opposed: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), doc="the sensor's place moves against the first mode's motion"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        gain = -self.gain if self.opposed else self.gain
        if draft.excitation != "waveform":
            draft.modes.append(Mode(self.frequency_hz, self.damping_ratio, gain))
            return
        fs_hz, band = draft.condition.fs_hz, (self.frequency_hz, self.damping_ratio, gain)
        draft.filters.append(lambda x: _filtered(x, _raised(_length(x.size), fs_hz, *band)))

    def cannot_act_on(self, draft: Draft) -> str | None:
        return beyond_nyquist(draft, self.frequency_hz)


@register
@dataclass(frozen=True)
class SensorRolloff(Effect):
    """A low-pass of the sensor or its mounting: smooth loss above a corner, the same in all records.

    The analogue Butterworth response, so that the loss is right up to half the sampling rate and for corners above it.
    Disturbances come after the sensor and keep their level. So does the twin's white noise, but for the part of it that
    is a machine's broadband background: flow, seals and other bearings are heard by the sensor, too.
    """

    stage: ClassVar[Stage] = Stage.PATH
    references: ClassVar[tuple[str, ...]] = (
        "ISO 5348, Mechanical mounting of accelerometers",
        "Butterworth 1930, On the theory of filter amplifiers",
    )
    corner_hz: float = parameter(
        3000.0, unit="Hz", plausible=(500.0, 15000.0), allowed=(1.0, 1e7), log=True, doc="frequency of 3 dB loss"
    )
    order: int = parameter(2, unit="", plausible=(1, 6), allowed=(1, 12), doc="order: 6 dB per octave each")
    background: float = parameter(
        0.0, unit="", plausible=(0.0, 1.0), allowed=(0, 1), doc="part of the white noise's power that it passes on"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        fs_hz = draft.condition.fs_hz

        def heard(x: Array) -> Array:
            return _filtered(x, self._response(_length(x.size), fs_hz))

        draft.filters.append(heard)
        if self.background > 0:
            draft.heard.append((self.background, heard))

    def _response(self, n: int, fs_hz: float) -> Array:
        """At the frequencies of a real transform of n samples."""
        return _low_pass(n, fs_hz, self.corner_hz, self.order)


def beyond_nyquist(draft: Draft, frequency_hz: float) -> str | None:
    """Why a frequency cannot appear in this record, or None when it can."""
    if frequency_hz < draft.condition.fs_hz / 2:
        return None
    return (
        f"{frequency_hz:g} Hz lies above half the sampling rate of record {draft.condition.name!r}, "
        f"{draft.condition.fs_hz:g} Hz"
    )


def _filtered(x: Array, response: Array) -> Array:
    """A causal filter given by its response at the frequencies of a transform of `_length(x.size)` samples.

    The end runs into the beginning: into what the caller made before the record for the filter to settle, and cuts off.
    """
    length = _length(x.size)
    spectrum = scipy.fft.rfft(x, length)
    spectrum *= response
    return np.asarray(scipy.fft.irfft(spectrum, length)[: x.size])


def _length(n: int) -> int:
    """Length of a fast transform of n samples."""
    return int(scipy.fft.next_fast_len(n, real=True))


@lru_cache(maxsize=16)
def _low_pass(n: int, fs_hz: float, corner_hz: float, order: int) -> Array:
    """Analogue Butterworth response at the frequencies of a real transform of n samples."""
    place = 1j * scipy.fft.rfftfreq(n, 1 / fs_hz)[:, None] / corner_hz
    poles = np.exp(1j * np.pi * (2 * np.arange(1, order + 1) + order - 1) / (2 * order))
    return np.asarray(np.prod(-poles / (place - poles), axis=1))


@lru_cache(maxsize=16)
def _raised(n: int, fs_hz: float, centre_hz: float, damping_ratio: float, gain: float) -> Array:
    """1 + gain times a resonance of unit height, at the frequencies of a real transform of n samples."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    band = 2j * damping_ratio * f * centre_hz
    return np.asarray(1 + gain * band / (centre_hz**2 - f**2 + band))
