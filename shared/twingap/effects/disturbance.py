"""Disturbances: what reaches the sensor and is not the bearing's. All levels are multiples of the healthy RMS.

Tones tied to rotation follow the shaft angle, fluctuation and all. Harmonics above half the sampling rate are left out,
as an anti-alias filter would take them. All of these act alike on every twin and on finished waveforms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects.angle import cosine, harmonics
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.path import beyond_nyquist
from twingap.effects.registry import register
from twingap.effects.ringing import Mode, ring
from twingap.errors import TwingapError

Array = NDArray[np.float64]
Reals = NDArray[np.floating[Any]]

_RANDALL_BOOK = "Randall 2011, Vibration-based condition monitoring, Wiley"
_RANDALL = "Randall & Antoni 2011, Rolling element bearing diagnostics - a tutorial, doi:10.1016/j.ymssp.2010.07.017"


def _add_harmonics(draft: Draft, turns: Array, base_hz: float, levels: Reals, phases_turns: Reals) -> None:
    """Add cosines at multiples 1, 2, ... of `turns`, of `levels` healthy RMS, below half the sampling rate."""
    count = min(levels.size, math.ceil(draft.condition.fs_hz / 2 / base_hz) - 1)
    amplitudes = draft.reference_rms * levels * np.exp(2j * np.pi * phases_turns)
    draft.x += harmonics(turns, amplitudes[: max(count, 0)].tolist())


@register
@dataclass(frozen=True)
class ShaftHarmonics(Effect):
    """Tones at 1, 2 and 3 times shaft speed (unbalance, misalignment): they survive synchronous averaging.

    Phases are random from record to record, since records start at no particular shaft angle.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = ("ISO 13373-3, Guidelines for vibration diagnosis", _RANDALL_BOOK)
    level_1x: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 5.0), log=True, doc="amplitude at shaft speed (unbalance)"
    )
    level_2x: float = parameter(
        0.3, unit="healthy rms", plausible=(0.01, 5.0), log=True, doc="amplitude at twice shaft speed (misalignment)"
    )
    level_3x: float = parameter(
        0.15, unit="healthy rms", plausible=(0.005, 5.0), log=True, doc="amplitude at three times shaft speed"
    )

    @property
    def levels(self) -> Array:
        """[3] Amplitude of each, healthy rms."""
        return np.array([self.level_1x, self.level_2x, self.level_3x])

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        _add_harmonics(draft, draft.turns, draft.shaft_hz, self.levels, rng.random(3))


@register
@dataclass(frozen=True)
class Looseness(Effect):
    """Mechanical looseness: many shaft harmonics, and half orders between them.

    Order m = 1/2, 1, 3/2, ... up to `n_orders` has amplitude level decay^(m - 1), half orders times `half_ratio`. The
    harmonics are in phase once every two turns, as a knocking part makes them, or come with phases of their own, random
    from record to record, as a path of many modes leaves them.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = ("ISO 13373-3, Guidelines for vibration diagnosis", _RANDALL_BOOK)
    level: float = parameter(
        0.3, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude at shaft speed"
    )  # fmt: skip
    decay: float = parameter(
        0.85, unit="", plausible=(0.5, 0.98), allowed=(0.05, 1),
        doc="amplitude of one order over that of the one before",
    )  # fmt: skip
    half_ratio: float = parameter(
        0.6, unit="", plausible=(0.1, 1.5), allowed=(0, 100), doc="half orders over the trend of whole ones"
    )
    n_orders: int = parameter(
        10, unit="", plausible=(5, 20), allowed=(1, 200), fitted=False, doc="highest order"
    )  # fmt: skip
    in_phase: bool = parameter(
        True, unit="", plausible=(0, 1), allowed=(0, 1), doc="orders meet once every two turns, as a knock makes them"
    )

    @property
    def levels(self) -> Array:
        """[2 n_orders] Amplitude of each half order, healthy rms."""
        half = np.arange(1, 2 * self.n_orders + 1)
        return self.level * self.decay ** (half / 2 - 1) * np.where(half % 2, self.half_ratio, 1.0)

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        levels = self.levels
        phases = np.arange(1, levels.size + 1) * rng.random() if self.in_phase else rng.random(levels.size)
        _add_harmonics(draft, draft.turns / 2, draft.shaft_hz / 2, levels, phases)


@register
@dataclass(frozen=True)
class MainsInterference(Effect):
    """Hum of the mains and its harmonics: fixed in Hz whatever the speed, of zero width."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = ("EN 50160, Voltage characteristics of electricity (50 Hz)", _RANDALL_BOOK)
    level: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude of the fundamental"
    )
    decay: float = parameter(
        0.6, unit="", plausible=(0.2, 0.95), allowed=(0, 1), doc="amplitude of one harmonic over that of the one before"
    )
    mains_hz: float = parameter(
        50.0, unit="Hz", plausible=(50.0, 60.0), allowed=(50.0, 60.0), fitted=False, doc="50 or 60 Hz"
    )
    n_harmonics: int = parameter(
        6, unit="", plausible=(3, 20), allowed=(1, 200), fitted=False, doc="number of harmonics"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mains_hz not in (50, 60):
            raise TwingapError(f"{self.mains_hz!r} found, 50 or 60 Hz expected", where=f"effect {self.name}: mains_hz")

    @property
    def levels(self) -> Array:
        """[n_harmonics] Amplitude of each, healthy rms."""
        return np.asarray(self.level * self.decay ** np.arange(self.n_harmonics))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        levels = self.levels
        _add_harmonics(draft, self.mains_hz * draft.t, self.mains_hz, levels, rng.random(levels.size))


@register
@dataclass(frozen=True)
class DriveInterference(Effect):
    """Variable-speed drive or motor: a fixed carrier with a pair of lines about it, at a multiple of shaft speed."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Smith & Randall 2015, Rolling element bearing diagnostics using the Case Western Reserve University data: a "
        "benchmark study (electromagnetic interference of the drive)",
    )
    level: float = parameter(0.5, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude of the carrier")
    depth: float = parameter(
        1.0, unit="", plausible=(0.1, 2.0), allowed=(0, 100.0), doc="modulation: each side line is depth / 2 carriers"
    )
    carrier_hz: float = parameter(
        4000.0, unit="Hz", plausible=(500.0, 16000.0), allowed=(1.0, 1e7), log=True, doc="carrier frequency"
    )
    sideband_order: float = parameter(
        2.0, unit="orders", plausible=(1.0, 8.0), allowed=(1e-3, 1e3), doc="distance of the side lines from the carrier"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        phases = rng.random(2)
        carrier = cosine(self.carrier_hz * draft.t + phases[0])
        carrier *= 1 + self.depth * cosine(self.sideband_order * draft.turns + phases[1])
        draft.x += self.level * draft.reference_rms * carrier

    def cannot_act_on(self, draft: Draft) -> str | None:
        return beyond_nyquist(draft, self.carrier_hz + self.sideband_order * draft.shaft_hz)


@register
@dataclass(frozen=True)
class GearMesh(Effect):
    """A gear on the shaft: tones at whole orders (teeth and its harmonics), each with side lines one order away."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Randall 1982, A new method of modeling gear faults",
        "ISO 13373-3, Guidelines for vibration diagnosis",
    )
    level: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 5.0), log=True, doc="amplitude of the mesh tone"
    )  # fmt: skip
    decay: float = parameter(
        0.5, unit="", plausible=(0.1, 0.9), allowed=(0, 1), doc="amplitude of one mesh harmonic over the one before"
    )
    depth: float = parameter(
        0.5,
        unit="",
        plausible=(0.05, 1.5),
        allowed=(0, 100.0),
        doc="modulation: each side line is depth / 2 mesh tones",
    )
    teeth: int = parameter(23, unit="", plausible=(11, 80), allowed=(1, 100000), doc="teeth of the gear on the shaft")
    n_harmonics: int = parameter(
        3, unit="", plausible=(1, 6), allowed=(1, 100), fitted=False, doc="number of mesh harmonics"
    )

    @property
    def levels(self) -> Array:
        """[n_harmonics] Amplitude of each mesh tone, healthy rms."""
        return np.asarray(self.level * self.decay ** np.arange(self.n_harmonics))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        phases = rng.random(self.n_harmonics)
        levels = draft.reference_rms * self.levels
        # The highest side line lies one order above its mesh harmonic.
        count = math.ceil((draft.condition.fs_hz / 2 / draft.shaft_hz - 1) / self.teeth) - 1
        amplitudes = (levels * np.exp(2j * np.pi * phases))[: max(count, 0)]
        swing = 1 + self.depth * cosine(draft.turns + rng.random())
        draft.x += swing * harmonics(self.teeth * draft.turns, amplitudes.tolist())

    def cannot_act_on(self, draft: Draft) -> str | None:
        return beyond_nyquist(draft, (self.teeth + 1) * draft.shaft_hz)


@register
@dataclass(frozen=True)
class ForeignBearing(Effect):
    """Another bearing's fault: impacts at an order that is not this bearing's, through a mode of their own."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (_RANDALL,)
    level: float = parameter(
        5.0, unit="healthy rms", plausible=(0.5, 20.0), log=True, doc="amplitude of an impact's response"
    )
    order: float = parameter(
        4.37, unit="orders", plausible=(2.0, 12.0), allowed=(1e-3, 1e4), doc="impacts per turn of this shaft"
    )
    resonance_hz: float = parameter(
        2500.0, unit="Hz", plausible=(500.0, 15000.0), allowed=(1.0, 1e7), log=True, doc="natural frequency of its mode"
    )
    damping_ratio: float = parameter(
        0.05, unit="", plausible=(0.01, 0.2), allowed=(1e-4, 0.99), log=True, doc="damping ratio of its mode"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        mode = Mode(self.resonance_hz, self.damping_ratio, self.level * draft.reference_rms)
        before = math.ceil(mode.ringing_s * draft.shaft_hz * self.order) + 1
        count = np.arange(-before, math.ceil(draft.turns[-1] * self.order) + 1)
        turns = (count + rng.random()) / self.order
        turns, strengths = self._strikes(turns, rng)
        draft.x += ring([mode], draft.condition.fs_hz, draft.x.size, draft.when(turns), strengths)

    def _strikes(self, turns: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Shaft angles and strengths of strikes that would come evenly, at these angles, and alike."""
        return turns, np.ones(turns.size)

    def cannot_act_on(self, draft: Draft) -> str | None:
        return beyond_nyquist(draft, self.resonance_hz)


@register
@dataclass(frozen=True)
class ColouredNoise(Effect):
    """Stationary Gaussian background whose power falls or rises as f^-slope between two frequencies.

    Pumps and flow have a slope, a neighbouring machine a band. Its envelope spectrum is flat.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Timmer & Koenig 1995, On generating power law noise, Astronomy and Astrophysics 300",
    )
    level: float = parameter(0.7, unit="healthy rms", plausible=(0.05, 5.0), log=True, doc="rms of the noise")
    slope: float = parameter(
        1.0, unit="", plausible=(-1.0, 2.5), allowed=(-6, 6), doc="power falls as f^-slope: 0 flat, 1 pink, 2 brown"
    )
    low_hz: float = parameter(
        20.0, unit="Hz", plausible=(5.0, 5000.0), allowed=(1e-3, 1e7), log=True, doc="lower end of the band"
    )
    high_hz: float = parameter(
        20000.0, unit="Hz", plausible=(200.0, 25000.0), allowed=(1e-3, 1e9), log=True, doc="upper end of the band"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low_hz >= self.high_hz:
            raise TwingapError(
                f"low_hz = {self.low_hz:g}, below high_hz = {self.high_hz:g} expected", where=f"effect {self.name}"
            )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        n = draft.x.size
        # A transform makes noise that repeats: longer than the record, so that its end does not run into its start.
        apart = min(n, math.ceil(2 * draft.condition.fs_hz / self.low_hz))
        length = scipy.fft.next_fast_len(n + apart, real=True)
        weights = _power_law(length, draft.condition.fs_hz, self.slope, self.low_hz, self.high_hz)
        spectrum = rng.standard_normal(2 * weights.size).view(complex)
        spectrum *= weights
        noise = scipy.fft.irfft(spectrum, length)[:n]
        draft.x += self.level * draft.reference_rms * noise

    def cannot_act_on(self, draft: Draft) -> str | None:
        return beyond_nyquist(draft, self.low_hz)


@lru_cache(maxsize=16)
def _power_law(n: int, fs_hz: float, slope: float, low_hz: float, high_hz: float) -> Array:
    """Weights that make unit complex normals the spectrum of noise of expected variance 1."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    inside = (f >= low_hz) & (f <= high_hz)
    inside[0] = False
    if n % 2 == 0:
        inside[-1] = False  # the bin at half the rate would have to be real
    if not inside.any():
        # A band between two bins of a short record: its nearest bin stands for it.
        inside[min(max(int(np.argmin(np.abs(f - low_hz))), min(1, f.size - 1)), f.size - 1)] = True
    weights = np.where(inside, np.maximum(f, f[min(1, f.size - 1)] or 1.0) ** (-slope / 2), 0.0)
    # Each inner bin and its mirror carry |X|^2 with E|X|^2 = 2 w^2; irfft divides by n.
    return np.asarray(weights * (n / (2 * math.sqrt(float((weights**2).sum())))))


@register
@dataclass(frozen=True)
class ImpulsiveNoise(Effect):
    """Random knocks tied to no rotation: a Poisson process of gamma-distributed strengths, either sign.

    With a spread of 1 strengths are exponential, as of many causes near and far; one loose part knocks more evenly.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Borghesani & Antoni 2017, CS2 analysis in presence of non-Gaussian background noise",
    )
    level: float = parameter(
        15.0, unit="healthy rms", plausible=(2.0, 60.0), log=True, doc="mean amplitude of a knock's response"
    )
    rate_hz: float = parameter(
        4.0, unit="1/s", plausible=(0.5, 50.0), allowed=(0, 1e5), log=True, doc="mean number of knocks per second"
    )
    resonance_hz: float = parameter(
        2200.0, unit="Hz", plausible=(300.0, 15000.0), allowed=(1.0, 1e7), log=True, doc="natural frequency of its mode"
    )
    damping_ratio: float = parameter(
        0.06, unit="", plausible=(0.01, 0.3), allowed=(1e-4, 0.99), log=True, doc="damping ratio of its mode"
    )
    spread: float = parameter(
        1.0, unit="", plausible=(0.15, 1.0), allowed=(0, 3.0), doc="standard deviation of the strengths over their mean"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        mode = Mode(self.resonance_hz, self.damping_ratio, self.level * draft.reference_rms)
        begin, end = -mode.ringing_s, draft.condition.duration_s
        count = rng.poisson(self.rate_hz * (end - begin))
        times = rng.uniform(begin, end, count)
        draft.x += ring([mode], draft.condition.fs_hz, draft.x.size, times, self._strengths(count, rng))

    def _strengths(self, count: int, rng: np.random.Generator) -> Array:
        """[count] Of mean size 1."""
        shape = 1 / max(self.spread, 1e-3) ** 2
        return np.asarray(rng.gamma(shape, 1 / shape, count) * rng.choice((-1.0, 1.0), count))

    def cannot_act_on(self, draft: Draft) -> str | None:
        return beyond_nyquist(draft, self.resonance_hz)


@register
@dataclass(frozen=True)
class Waviness(Effect):
    """Wavy races: sinusoids at multiples of the ball-pass order, following the shaft angle and the cage's slip.

    In every record, healthy or not. Lines in the raw spectrum; the envelope of a resonance band does not know them.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Harsha, Sandeep & Prakash 2003, The effect of speed of balanced rotor on nonlinear vibrations associated with "
        "ball bearings",
        "Yhland 1992, A linear theory of vibrations caused by ball bearings with form errors",
    )
    level: float = parameter(
        0.5, unit="healthy rms", plausible=(0.02, 3.0), log=True, doc="amplitude at the ball-pass order"
    )
    decay: float = parameter(
        0.6, unit="", plausible=(0.2, 0.95), allowed=(0, 1), doc="amplitude of one multiple over that of the one before"
    )
    n_harmonics: int = parameter(
        4, unit="", plausible=(1, 10), allowed=(1, 100), fitted=False, doc="number of multiples"
    )
    inner: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), fitted=False, doc="wavy inner race (BPFI), not outer (BPFO)"
    )

    @property
    def levels(self) -> Array:
        """[n_harmonics] Amplitude at each multiple, healthy rms."""
        return np.asarray(self.level * self.decay ** np.arange(self.n_harmonics))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        order = draft.bearing.slipped(draft.cage_speed_ratio)["inner" if self.inner else "outer"]
        levels = self.levels
        _add_harmonics(draft, order * draft.turns, order * draft.shaft_hz, levels, rng.random(levels.size))
