"""Low-pass of the sensor or its mounting."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import SHAPE
from twingap.effects._filtering import fast_length, filtered
from twingap.effects._gains import check_places, few_places, minimum_phase
from twingap.effects._spectral_fits import misfit_at_any_level, misfit_of_modes
from twingap.effects.base import Effect, Stage, parameter, profile
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform
from twingap.effects.machine import Machine
from twingap.effects.observations import HealthySpectrum, Observations
from twingap.effects.registry import register

Array = NDArray[np.float64]

_ORDERS: Final = (1, 2, 3, 5)
_CORNERS: Final = np.geomspace(0.02, 0.8, 14)
"""Of the sampling rate."""
_BACKGROUNDS: Final = (0.0, 0.8, 0.95, 0.985, 1.0)
_SHIFTS: Final = (-0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1)
"""Trial shifts, logarithmic, of the mode from its calibrated frequency and from the highest peak."""
_DAMPINGS: Final = (0.01, 0.018, 0.03, 0.05, 0.09, 0.16)
"""Damping ratios of the mode."""
_BEST_FITS: Final = 5
"""Best fits that are returned. More cost one calibration each."""


@register
@dataclass(frozen=True)
class SensorRolloff(Effect):
    """A low-pass of the sensor or its mounting: roll-off above a corner frequency, the same in all records.

    The response is an analogue Butterworth filter, exact up to half the sampling rate and for corners above it, or of
    minimum phase with the gains that were measured.
    Disturbances are added after the sensor and keep their level. So does the twin's white noise, except for the part
    `background`, the broadband vibration of the machine (flow, seals, other bearings), which passes the sensor.
    """

    stage: ClassVar[Stage] = Stage.PATH
    references: ClassVar[tuple[str, ...]] = (
        "ISO 5348, Mechanical mounting of accelerometers",
        "Butterworth 1930, On the theory of filter amplifiers",
    )
    group: ClassVar[str] = "path"
    look_alikes: ClassVar[tuple[str, ...]] = ("second_resonance", "coloured_noise")
    deciding_measurement: ClassVar[str] = measurements.HAMMER
    features: ClassVar[tuple[str, ...]] = SHAPE
    draw_weight: ClassVar[float] = 1.7
    told_from_paths: ClassVar[bool] = True

    corner_hz: float = parameter(
        3000.0, unit="Hz", plausible=(500.0, 15000.0), allowed=(1.0, 1e7), log=True, above_nyquist=True,
        doc="frequency of 3 dB attenuation",
    )  # fmt: skip
    order: int = parameter(
        2, unit="", plausible=(1, 6), allowed=(1, 12), exact=True, doc="order of the filter: 6 dB per octave each"
    )
    background: float = parameter(
        0.0, unit="", plausible=(0.0, 1.0), allowed=(0, 1), doc="part of the white noise's power that passes the sensor"
    )
    frequencies_hz: tuple[float, ...] = profile((), unit="Hz", doc="frequencies of measured gains, increasing")
    gains_db: tuple[float, ...] = profile(
        (), unit="dB", allowed=(-150.0, 0.0), doc="gain at each, where measured; in place of corner and order"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_places(self, self.frequencies_hz, self.gains_db, "gains_db")

    @property
    def listed_profiles(self) -> Mapping[str, tuple[float, ...]]:
        places, values = few_places(self.frequencies_hz, self.gains_db)
        return {"frequencies_hz": places, "gains_db": values}

    @property
    def measured_parameters(self) -> frozenset[str]:
        return frozenset({"corner_hz", "order"}) if self.frequencies_hz else frozenset()

    def gain_db(self, frequencies_hz: Array) -> Array:
        """Gain at these frequencies, dB."""
        if self.frequencies_hz:
            return np.asarray(np.interp(frequencies_hz, self.frequencies_hz, self.gains_db))
        return np.asarray(-10 * np.log10(1 + (frequencies_hz / self.corner_hz) ** (2 * self.order)))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        fs_hz = draft.condition.fs_hz

        def sensed(x: Array) -> Array:
            return filtered(x, self._response(fast_length(x.size), fs_hz))

        draft.filters.append(sensed)
        if self.background > 0:
            draft.sensed_noise.append((self.background, sensed))

    def _response(self, n: int, fs_hz: float) -> NDArray[np.complex128]:
        """At the frequencies of a real transform of n samples."""
        if self.frequencies_hz:
            return minimum_phase(n, fs_hz, self.frequencies_hz, self.gains_db)
        return _low_pass(n, fs_hz, self.corner_hz, self.order)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        order, loss_db = int(rng.integers(1, 7)), log_uniform(rng, 1.0, 18.0)
        # Attenuation at the resonance, or at high frequencies, where only background is left.
        at_hz = machine.parameters.resonance_hz
        if rng.random() < 0.5:
            at_hz = max(at_hz, rng.uniform(0.2, 0.45) * machine.conditions[0].fs_hz)
        # Most of the noise between modes is the machine's, or most is the chain's.
        background = 0.0 if rng.random() < 0.3 else 1 - 10 ** rng.uniform(-2.5, -0.1)
        corner_hz = at_hz / (10 ** (loss_db / 10) - 1) ** (0.5 / order)
        return {"corner_hz": corner_hz, "order": order, "background": background}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return RealPoleRolloff(**self.parameter_values())

    def spectral_values(self, seen: Observations) -> Sequence[Effect]:
        """The low-passes that explain the healthy spectra best, each with its best mode and levels.

        The spectrum of a twin with a low-pass has a closed form: roll-off times (structure noise through its mode, and
        the part of the white noise that passes the sensor), plus white noise behind it; for finished waveforms, the
        roll-off times their spectrum. Other effects are not included. A wrong damping of the mode can compensate for a
        wrong order, so that both are fitted together.
        """
        healthy = seen.healthy()
        if healthy is None:
            return ()
        return [
            dataclasses.replace(self, order=order, corner_hz=corner * healthy.fs_hz, background=background)
            for _, order, corner, background in sorted(self._scored(healthy))[:_BEST_FITS]
        ]

    def _scored(self, healthy: HealthySpectrum) -> list[tuple[float, int, float, float]]:
        """Misfit, order, corner over the sampling rate, and background."""
        inside = slice(2, int(0.92 * healthy.density.size))
        f = healthy.places[inside]
        wanted = healthy.density[inside] * healthy.fs_hz
        wanted = np.maximum(wanted, 1e-9 * wanted.max())  # a band in which a coarse converter shows nothing
        rolloffs = [(order, float(c), 1 / (1 + (f / c) ** (2 * order))) for order in _ORDERS for c in _CORNERS]
        if not healthy.centres_hz:
            bare = np.maximum(healthy.twin()[inside] * healthy.fs_hz, 1e-300)
            return [(misfit_at_any_level(bare * kept, wanted), n, c, self.background) for n, c, kept in rolloffs]
        modes = np.array([
            healthy.mode(centre * math.exp(shift), width)[inside] * healthy.fs_hz
            for centre in healthy.centres_hz for shift in _SHIFTS for width in _DAMPINGS
        ])  # fmt: skip
        return [
            (misfit_of_modes(modes * kept, 2 * (part * kept + 1 - part), wanted), order, corner, part)
            for order, corner, kept in rolloffs for part in _BACKGROUNDS
        ]  # fmt: skip


@lru_cache(maxsize=16)
def _low_pass(n: int, fs_hz: float, corner_hz: float, order: int) -> NDArray[np.complex128]:
    """Analogue Butterworth response at the frequencies of a real transform of n samples."""
    place = 1j * scipy.fft.rfftfreq(n, 1 / fs_hz)[:, None] / corner_hz
    poles = np.exp(1j * np.pi * (2 * np.arange(1, order + 1) + order - 1) / (2 * order))
    return np.asarray(np.prod(-poles / (place - poles), axis=1))


@dataclass(frozen=True)
class RealPoleRolloff(SensorRolloff):
    """Equal real poles, as many as the order (glue, cables, wax), with 3 dB at the same corner."""

    def _response(self, n: int, fs_hz: float) -> NDArray[np.complex128]:
        pole_hz = self.corner_hz / math.sqrt(2 ** (1 / self.order) - 1)
        return np.asarray((1 + 1j * scipy.fft.rfftfreq(n, 1 / fs_hz) / pole_hz) ** -self.order)
