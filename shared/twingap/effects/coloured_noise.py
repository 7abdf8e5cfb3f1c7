"""Background noise with a spectral slope or in a band."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy import signal

from twingap.effects import measurements
from twingap.effects._features import SHAPE
from twingap.effects._gains import check_places, few_places
from twingap.effects._shaped_noise import shaped_noise
from twingap.effects._spectral_fits import least_misfit
from twingap.effects.base import Effect, Stage, parameter, profile
from twingap.effects.draft import Draft
from twingap.effects.drawing import healthy_density, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.observations import HealthySpectrum, Observations
from twingap.effects.registry import register
from twingap.errors import TwingapError

Array = NDArray[np.float64]

_LOWS: Final = np.geomspace(0.004, 0.42, 16)
_HIGHS: Final = np.geomspace(0.02, 0.5, 16)
"""Ends of bands of noise, of the sampling rate."""
_SLOPES: Final = (-1.0, 0.0, 1.0, 2.0)
_SHIFTS: Final = (-0.03, 0.0, 0.03)
_DAMPINGS: Final = (0.01, 0.018, 0.03, 0.05, 0.09, 0.16)
"""Trial values of the twin's own mode: logarithmic shifts of its frequency, and damping ratios."""
_BEST_FITS: Final = 5
"""Best fits that are returned. More cost one calibration each."""
_NARROWEST: Final = 0.985
"""Lower over upper end of a band above which both estimates cross, and the lower end is set to 0.9 of the upper."""


@register
@dataclass(frozen=True)
class ColouredNoise(Effect):
    """Stationary Gaussian background whose power falls or rises as f^-slope between two frequencies.

    Pumps and flow have a slope, a neighbouring machine a band. Its envelope spectrum is flat. Where its density was
    measured, the noise has that one, at the level.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Timmer & Koenig 1995, On generating power law noise, Astronomy and Astrophysics 300",
    )
    group: ClassVar[str] = "background"
    look_alikes: ClassVar[tuple[str, ...]] = ("second_resonance", "sensor_rolloff", "distributed_roughness")
    deciding_measurement: ClassVar[str] = measurements.BACKGROUND
    features: ClassVar[tuple[str, ...]] = SHAPE
    draw_weight: ClassVar[float] = 1.7

    level: float = parameter(0.7, unit="healthy rms", plausible=(0.05, 5.0), log=True, doc="rms of the noise")
    slope: float = parameter(
        1.0, unit="", plausible=(-1.0, 2.5), allowed=(-6, 6), doc="power falls as f^-slope: 0 flat, 1 pink, 2 brown"
    )
    low_hz: float = parameter(
        20.0, unit="Hz", plausible=(5.0, 5000.0), allowed=(1e-3, 1e7), log=True, doc="lower end of the band"
    )
    high_hz: float = parameter(
        20000.0, unit="Hz", plausible=(200.0, 25000.0), allowed=(1e-3, 1e9), log=True, above_nyquist=True,
        doc="upper end of the band",
    )  # fmt: skip
    frequencies_hz: tuple[float, ...] = profile((), unit="Hz", doc="frequencies of measured densities, increasing")
    densities_db: tuple[float, ...] = profile(
        (), unit="dB of the noise's power per Hz", allowed=(-300.0, 100.0),
        doc="density at each, where measured; in place of slope and band",
    )  # fmt: skip

    @property
    def listed_profiles(self) -> Mapping[str, tuple[float, ...]]:
        places, values = few_places(self.frequencies_hz, self.densities_db)
        return {"frequencies_hz": places, "densities_db": values}

    @property
    def measured_parameters(self) -> frozenset[str]:
        return frozenset({"slope", "low_hz", "high_hz"}) if self.frequencies_hz else frozenset()

    def __post_init__(self) -> None:
        super().__post_init__()
        check_places(self, self.frequencies_hz, self.densities_db, "densities_db")
        if self.low_hz >= self.high_hz:
            raise TwingapError(
                f"low_hz = {self.low_hz:g}, below high_hz = {self.high_hz:g} expected", where=f"effect {self.name}"
            )

    def density(self, frequencies_hz: Array, fs_hz: float) -> Array:
        """One-sided density at these frequencies, 1/Hz, of a noise of unit variance."""
        if self.frequencies_hz:
            return np.asarray(10 ** (np.interp(frequencies_hz, self.frequencies_hz, self.densities_db) / 10))
        f = np.linspace(self.low_hz, min(self.high_hz, fs_hz / 2), 1000)
        inside = (frequencies_hz >= self.low_hz) & (frequencies_hz <= self.high_hz)
        power = np.where(inside, np.maximum(frequencies_hz, self.low_hz) ** -self.slope, 0.0)
        return np.asarray(power / max(float(np.trapezoid(f**-self.slope, f)), 1e-300))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        n = draft.x.size
        if self.frequencies_hz:
            noise = shaped_noise(n, draft.condition.fs_hz, self.frequencies_hz, self.densities_db, rng)
            draft.x += self.level * draft.reference_rms * noise
            return
        # Noise from a transform is periodic: longer than the record, so that its end does not correlate with its start.
        apart = min(n, math.ceil(2 * draft.condition.fs_hz / self.low_hz))
        length = scipy.fft.next_fast_len(n + apart, real=True)
        weights = _power_law(length, draft.condition.fs_hz, self.slope, self.low_hz, self.high_hz)
        spectrum = rng.standard_normal(2 * weights.size).view(complex)
        spectrum *= weights
        noise = scipy.fft.irfft(spectrum, length)[:n]
        draft.x += self.level * draft.reference_rms * noise

    def cannot_act_on(self, draft: Draft) -> str | None:
        return draft.beyond_nyquist(self.low_hz)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        fs_hz = machine.conditions[0].fs_hz
        if rng.random() < 0.55:  # a slope from pumps and flow
            slope = rng.uniform(0.6, 2.5) if rng.random() < 0.85 else rng.uniform(-1.0, -0.6)
            low, high = log_uniform(rng, 0.001, 0.01) * fs_hz, log_uniform(rng, 0.2, 1.2) * fs_hz
            return {"level": log_uniform(rng, 0.2, 4.0), "slope": slope, "low_hz": low, "high_hz": high}
        low, width = fs_hz * rng.uniform(0.005, 0.4), fs_hz * rng.uniform(0.01, 0.15)  # a band from a neighbour
        power = (10 ** (rng.uniform(1.2, 15.0) / 10) - 1) * healthy_density(machine, low + width / 2) * width
        own = machine.parameters
        level = math.sqrt(power) / math.hypot(own.structure_noise_rms, own.white_noise_rms)
        return {"level": level, "slope": rng.uniform(-0.3, 0.5), "low_hz": low, "high_hz": low + width}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect | None:
        return LowPassedNoise(**self.parameter_values()) if self.slope >= 0.6 else None

    @classmethod
    def consistent(cls, values: dict[str, float]) -> dict[str, float]:
        if values["low_hz"] >= _NARROWEST * values["high_hz"]:
            values["low_hz"] = 0.9 * values["high_hz"]
        return values

    def spectral_values(self, seen: Observations) -> Sequence[Effect]:
        """The bands and slopes that explain the healthy spectra best, together with a mode and white noise.

        Finished waveforms have one level instead of mode and white noise. A wide mode can compensate for a band of
        noise, so that both are fitted together.
        """
        healthy = seen.healthy()
        if healthy is None:
            return ()
        fs_hz = healthy.fs_hz
        return [
            dataclasses.replace(self, level=level, slope=slope, low_hz=low * fs_hz, high_hz=high * fs_hz)
            for _, low, high, slope, level in sorted(_scored(healthy))[:_BEST_FITS]
        ]


def _scored(healthy: HealthySpectrum) -> Iterator[tuple[float, float, float, float, float]]:
    """Misfit, both ends of the band over the sampling rate, slope and level."""
    bands, fs_hz = healthy.density.size, healthy.fs_hz
    inside = slice(1, int(0.92 * bands))
    f = healthy.places[inside]
    wanted = np.maximum(healthy.density[inside] * fs_hz, 1e-9 * healthy.density[inside].max() * fs_hz)
    if healthy.centres_hz:
        white = np.full(f.size, 2.0)
        own = [
            np.stack([fs_hz * healthy.mode(centre * math.exp(shift), width)[inside], white])
            for centre in healthy.centres_hz for shift in _SHIFTS for width in _DAMPINGS
        ]  # fmt: skip
    else:
        bare = np.maximum(healthy.twin()[inside], 1e-300)
        own = [2 * bare[None] / bare.mean()]
    for low, high in itertools.product(_LOWS, _HIGHS):
        if high < 1.2 * low:
            continue
        for slope in _SLOPES:
            shape = np.where((f >= low) & (f <= high), f**-slope, 0.0)
            if not shape.any():
                continue
            band = 2 * shape / (shape.sum() / (2 * bands) * 2)
            misfit, powers = least_misfit(np.stack([np.concatenate((rest, band[None])) for rest in own]), wanted)
            if powers[-1] > 0 and powers[:-1].sum() > 0:
                yield misfit, float(low), float(high), slope, math.sqrt(powers[-1] / powers[:-1].sum())


@lru_cache(maxsize=16)
def _power_law(n: int, fs_hz: float, slope: float, low_hz: float, high_hz: float) -> Array:
    """Weights that make unit complex normals the spectrum of noise of expected variance 1."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    inside = (f >= low_hz) & (f <= high_hz)
    inside[0] = False
    if n % 2 == 0:
        inside[-1] = False  # the bin at half the rate would have to be real
    if not inside.any():
        # A band between two bins of a short record: use the nearest bin.
        inside[min(max(int(np.argmin(np.abs(f - low_hz))), min(1, f.size - 1)), f.size - 1)] = True
    weights = np.where(inside, np.maximum(f, f[min(1, f.size - 1)] or 1.0) ** (-slope / 2), 0.0)
    # Each inner bin and its mirror carry |X|^2 with E|X|^2 = 2 w^2; irfft divides by n.
    return np.asarray(weights * (n / (2 * math.sqrt(float((weights**2).sum())))))


@dataclass(frozen=True)
class LowPassedNoise(ColouredNoise):
    """Noise that has passed a low-pass of one or two poles: flat, then falling, not a power law."""

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        # Number of poles nearest to the slope; corner near the lower end of the band.
        poles = 1 if self.slope < 1.5 else 2
        b, a = signal.butter(poles, min(4 * self.low_hz, 0.4 * draft.condition.fs_hz), fs=draft.condition.fs_hz)
        begin = math.ceil(draft.condition.fs_hz / self.low_hz)
        noise = signal.lfilter(b, a, rng.standard_normal(begin + draft.x.size))[begin:]
        draft.x += self.level * draft.reference_rms * noise / max(float(noise.std()), 1e-300)
